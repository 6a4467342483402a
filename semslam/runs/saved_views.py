"""Keyframes of a saved run with their optimised poses and, read from the sequence, their images."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError, ResultsError
from semslam.frontend.moving.movers import make_movers, standing_at
from semslam.maps.views import PosedView
from semslam.runs.recording import Recording, read_front_end
from semslam.runs.results import SavedRun, read_run
from semslam.types import Transform

Progress = Callable[[int, int], None]


def silent(done: int, whole: int) -> None:
    """Report nothing."""


@dataclass(frozen=True, slots=True)
class PlacedKeyframe:
    """A keyframe of the largest map: its id, its frame in the sequence, its stamp in seconds and its pose (4, 4)."""

    id: int
    frame: int
    timestamp: float
    T_world_cam: Transform


@dataclass(frozen=True, slots=True, eq=False)
class SavedViews:
    """The keyframes of a saved run's largest map, with their sequence.

    Attributes:
        run: the run folder's content.
        recording: its front end's motions and keyframes.
        dataset: the sequence it ran on.
        keyframes: in order.
    """

    run: SavedRun
    recording: Recording
    dataset: Dataset
    keyframes: tuple[PlacedKeyframe, ...]

    def between(self, start: float, end: float) -> "SavedViews":
        """The keyframes with stamps in [start, end), seconds.

        Raises:
            ResultsError: there is none.
        """
        kept = tuple(keyframe for keyframe in self.keyframes if start <= keyframe.timestamp < end)
        if not kept:
            raise ResultsError(f"{self.run.directory} has no keyframe between {start:g} and {end:g} s.")
        return replace(self, keyframes=kept)

    def read(self, progress: Progress = silent) -> Iterator[PosedView]:
        """Read the keyframes' images one by one, without depth where something moves if the run left that out.

        Args:
            progress: called with the keyframes done and in all.

        Raises:
            DatasetError: an image can no longer be read.
        """
        movers = make_movers(self.run.config.dynamics)
        for done, keyframe in enumerate(self.keyframes, start=1):
            frame = standing_at(movers, self.dataset.frame(keyframe.frame), keyframe.T_world_cam)
            yield PosedView(keyframe.id, frame, keyframe.T_world_cam)
            progress(done, len(self.keyframes))


def find_images(directory: Path, sequence: str | None = None) -> tuple[Dataset | None, str | None]:
    """The sequence of a saved run, or None and the reason why it cannot be read.

    Args:
        directory: the run folder.
        sequence: where the images are now; None = where they were.

    Raises:
        ResultsError: it is no run folder, or it is damaged.
        DatasetError: the images that ``sequence`` names cannot be had.
    """
    saved = read_front_end(directory)
    source = sequence or saved.source
    if source is None:
        return None, f"{directory} does not say where they are."
    try:
        dataset = saved.recording.sequence(open_dataset(source, config=saved.config.dataset))
    except DatasetError as error:
        if sequence is not None:
            raise
        return None, str(error)
    return dataset, None


def open_saved(directory: Path, sequence: str | None = None) -> SavedViews:
    """Open a saved run together with its sequence.

    Args:
        directory: the run folder.
        sequence: where the images are now; None = where they were.

    Raises:
        ResultsError: it is no run folder, it is damaged, or it does not know where its images are.
        DatasetError: the images are not there, or they are those of another sequence.
    """
    run, saved = read_run(directory), read_front_end(directory)
    source = sequence or saved.source
    if source is None:
        raise ResultsError(f"{directory} does not say where its images are; name the sequence with --sequence.")
    dataset = saved.recording.sequence(open_dataset(source, config=run.config.dataset))
    # Trajectory files keep nine decimals of a stamp.
    frames = {round(frame.timestamp, 9): frame.index for frame in saved.recording.frames}
    ids = {round(stamp, 9): id for id, stamp in run.keyframe_stamps.items()}
    try:
        keyframes = tuple(
            PlacedKeyframe(ids[round(stamp, 9)], frames[round(stamp, 9)], stamp, pose)
            for stamp, pose in zip(run.keyframes.timestamps.tolist(), run.keyframes.poses, strict=True)
        )
    except KeyError as error:
        raise ResultsError(f"The keyframes of {directory} are not among its frames; it is damaged.") from error
    return SavedViews(run, saved.recording, dataset, keyframes)
