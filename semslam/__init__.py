"""RGB-D SLAM whose loop closures come from semantics.

Names are imported when they are first used (PEP 562): the packages below this one import its modules, and
``import semslam`` must not pull in torch, open3d or gtsam.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

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


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'semslam' has no attribute '{name}'")


def __dir__() -> list[str]:
    return ["__version__", *sorted(_HOMES)]
