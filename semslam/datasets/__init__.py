"""Data in: sequences opened by path, read frame by frame.

dataset = open_dataset("rgbd_dataset_freiburg1_room")
for frame in dataset: ...
"""

import warnings
from pathlib import Path

from semslam import plugins
from semslam.config import DatasetConfig
from semslam.datasets.dataset import Dataset, DatasetLoader
from semslam.errors import FOREIGN, ConfigError, DatasetError, SemslamWarning, as_our_own

__all__ = ["Dataset", "DatasetLoader", "open_dataset"]

SYNTHETIC = "synthetic"
LOADER_SETTINGS = (
    "camera", "depth_scale", "association_window", "fps", "time_unit", "register_depth",
    "color_topic", "depth_topic", "camera_topic",
)  # fmt: skip
"""Settings that are for the loader; a loader names those it uses in its class attribute ``reads``."""


def open_dataset(path: str | Path, config: DatasetConfig | None = None, *, loader: str | None = None) -> Dataset:
    """Open a sequence; no image is read yet.

    Args:
        path: a folder, a ROS bag, or ``synthetic:SCENE?key=value``.
        config: which frames are read, and how.
        loader: registered name of its kind; None = that of the settings, or else guessed from the path.

    Returns:
        The sequence with start, stride, max_frames and faults of the settings applied.

    Raises:
        DatasetError: there is no such path, it is no sequence, or its lists are not usable.
        TrajectoryError: its ground truth is not readable.
        ConfigError: the loader's name is unknown, or a setting is given that it does not use.
    """
    config = config or DatasetConfig()
    if "\0" in str(path):
        raise DatasetError(f"{path} is no path: it holds a NUL.")
    try:
        name = loader or config.loader or guess_loader(path)
        kind: type[DatasetLoader] = plugins.load("semslam.datasets", name)
        _refuse_unused(name, kind, config)
        dataset: Dataset = kind.open(path, config)
    except OSError as error:
        raise DatasetError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeError as error:
        raise DatasetError(f"{path} is no path.") from error
    except FOREIGN as error:  # a loader from outside may raise what it likes
        raise as_our_own(error) from error
    if config.faults != type(config.faults)():
        from semslam.datasets.faults import FaultyDataset

        dataset = FaultyDataset(dataset, config.faults)
    if config.start or config.stride > 1 or config.max_frames is not None:
        from semslam.datasets.selection import Selection

        dataset = Selection(dataset, config.start, config.max_frames, config.stride)
    return dataset


def _refuse_unused(name: str, kind: type[DatasetLoader], config: DatasetConfig) -> None:
    """Refuse settings other than the defaults that the loader states not to use; one that states nothing may."""
    used = getattr(kind, "reads", LOADER_SETTINGS)
    for setting in LOADER_SETTINGS:
        if setting not in used and getattr(config, setting) != DatasetConfig.model_fields[setting].default:
            raise ConfigError(f"The loader '{name}' does not use the setting 'dataset.{setting}'.")


def guess_loader(path: str | Path) -> str:
    """The registered name of the loader for a path.

    ``synthetic`` and ``synthetic:...`` mean the rendered scenes unless there is such a path; every other loader
    is asked in turn whether it recognises the path.

    Raises:
        DatasetError: there is no such path, or no loader recognises it; the message lists what was looked for.
    """
    text, place = str(path), Path(path)
    if not place.exists():
        if text == SYNTHETIC or text.startswith(f"{SYNTHETIC}:"):
            return SYNTHETIC
        raise DatasetError(f"There is no folder or file {place}.")
    looked_for = []
    for name in plugins.names("semslam.datasets"):
        if name == SYNTHETIC:
            continue
        try:
            loader: type[DatasetLoader] = plugins.load("semslam.datasets", name)
            its_own = loader.recognises(place)
        except FOREIGN as error:  # a broken plug-in must not keep the others from being asked
            if name in plugins.DATASETS:
                raise
            warnings.warn(f"The loader '{name}' is passed over: {as_our_own(error)}", SemslamWarning, stacklevel=2)
            continue
        if its_own:
            return name
        looked_for.append(loader.layout)
    raise DatasetError(f"{place} is no sequence: looked for {'; '.join(looked_for)}.")
