"""RGB-D SLAM whose loop closures come from semantics.

Names are imported when they are first used (PEP 562): the packages below this one import its modules, and
``import semslam`` must not pull in torch, open3d or gtsam. A type checker reads the imports below instead.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semslam.config import Config, load_config
    from semslam.datasets import open_dataset
    from semslam.datasets.dataset import Dataset
    from semslam.errors import SemslamError
    from semslam.runs.pipeline import RunResult, run
    from semslam.system.closer import LoopCloser
    from semslam.system.slam import Slam
    from semslam.types import Frame, Intrinsics, Trajectory

# Before any module can import onnxruntime: it would send telemetry. semslam sends nothing.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"

__version__ = "0.1.0"

__all__ = [
    "Config",
    "Dataset",
    "Frame",
    "Intrinsics",
    "LoopCloser",
    "RunResult",
    "SemslamError",
    "Slam",
    "Trajectory",
    "__version__",
    "load_config",
    "open_dataset",
    "run",
]

_HOMES = {
    "Config": "semslam.config",
    "Dataset": "semslam.datasets.dataset",
    "Frame": "semslam.types",
    "Intrinsics": "semslam.types",
    "LoopCloser": "semslam.system.closer",
    "RunResult": "semslam.runs.pipeline",
    "SemslamError": "semslam.errors",
    "Slam": "semslam.system.slam",
    "Trajectory": "semslam.types",
    "load_config": "semslam.config",
    "open_dataset": "semslam.datasets",
    "run": "semslam.runs.pipeline",
}

if not TYPE_CHECKING:  # a type checker that saw this would take every misspelt name for Any

    def __getattr__(name):
        if name in _HOMES:
            return getattr(import_module(_HOMES[name]), name)
        raise AttributeError(f"module 'semslam' has no attribute '{name}'")


def __dir__() -> list[str]:
    return __all__
