"""Settings: one small frozen model per stage, joined in ``Config``; read from YAML, overridden, dumped."""

from semslam.config.backend import BackendConfig, BundleConfig, CovisibilityConfig
from semslam.config.dataset import DatasetConfig, FaultConfig, Interval
from semslam.config.detection import (
    Conv3Config,
    DbowConfig,
    DepthReading,
    DepthUnit,
    DistanceReading,
    FusedConfig,
    LoopConfig,
    MatchReading,
    NodeConfig,
    PaperSemanticConfig,
    SemanticConfig,
    ShareReading,
)
from semslam.config.features import FeatureConfig
from semslam.config.frontend import DenseConfig, FeatureMapConfig, FeatureOdometryConfig, KeyframeConfig, KissConfig
from semslam.config.section import Section
from semslam.config.segmentation import SegmentationConfig, TrainingConfig
from semslam.config.settings import Config, load_config, load_saved_config, parse_overrides
from semslam.config.verification import VerificationConfig

__all__ = [
    "BackendConfig",
    "BundleConfig",
    "Config",
    "Conv3Config",
    "CovisibilityConfig",
    "DatasetConfig",
    "DbowConfig",
    "DenseConfig",
    "DepthReading",
    "DepthUnit",
    "DistanceReading",
    "FaultConfig",
    "FeatureConfig",
    "FeatureMapConfig",
    "FeatureOdometryConfig",
    "FusedConfig",
    "Interval",
    "KeyframeConfig",
    "KissConfig",
    "LoopConfig",
    "MatchReading",
    "NodeConfig",
    "PaperSemanticConfig",
    "Section",
    "SegmentationConfig",
    "SemanticConfig",
    "ShareReading",
    "TrainingConfig",
    "VerificationConfig",
    "load_config",
    "load_saved_config",
    "parse_overrides",
]
