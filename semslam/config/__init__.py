"""Settings: one small frozen model per stage, joined in ``Config``; read from YAML, overridden, dumped.

Settings of a single implementation, such as one odometry, stand beside it.
"""

from semslam.config.backend import BackendConfig, BundleConfig, CovisibilityConfig
from semslam.config.dataset import DatasetConfig
from semslam.config.dynamics import DynamicsConfig
from semslam.config.faults import FaultConfig, Interval, parse_faults, written_faults
from semslam.config.keyframes import KeyframeConfig
from semslam.config.keypoints import KeypointConfig
from semslam.config.loops import LoopConfig
from semslam.config.reading import load_config, load_saved_config, parse_overrides
from semslam.config.section import Section, setting
from semslam.config.segmentation import SegmentationConfig, TrainingConfig
from semslam.config.settings import Config
from semslam.config.verification import SubmapConfig, VerificationConfig

__all__ = [
    "BackendConfig",
    "BundleConfig",
    "Config",
    "CovisibilityConfig",
    "DatasetConfig",
    "DynamicsConfig",
    "FaultConfig",
    "Interval",
    "KeyframeConfig",
    "KeypointConfig",
    "LoopConfig",
    "Section",
    "SegmentationConfig",
    "SubmapConfig",
    "TrainingConfig",
    "VerificationConfig",
    "load_config",
    "load_saved_config",
    "parse_faults",
    "parse_overrides",
    "setting",
    "written_faults",
]
