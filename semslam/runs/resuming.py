"""What a run that was killed is resumed with: its settings, its frames, and motions that are not tracked again."""

from pathlib import Path

from semslam.config import Config, load_saved_config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.datasets.kept_images import KeptFrames, KeptImages
from semslam.errors import ResultsError
from semslam.runs.journal import KEYFRAMES, JournalContent
from semslam.runs.journal_records import frame_of, landmarks_of
from semslam.runs.recording import Recording, read_front_end


def settings_of(past: JournalContent, work: Path) -> Config:
    """The settings of the run.

    Args:
        past: its journal.
        work: the folder that the journal lies in.

    Raises:
        ConfigError: they are not usable here, such as those of a plug-in that is gone.
    """
    file = work / "config.yaml"
    file.write_text(past.header.config, encoding="utf-8")
    return load_saved_config(file)


def motions_of(past: JournalContent) -> Recording | None:
    """Motions that are repeated instead of tracked: of another run, or of frames that came in real time.

    Raises:
        ResultsError: the other run is not there any more, or no frame came.
    """
    if past.header.realtime:
        return _recording(past)
    return None if past.header.saved_run is None else read_front_end(Path(past.header.saved_run)).recording


def frames_of(past: JournalContent, work: Path, config: Config, sequence: str | None) -> Dataset:
    """The frames of the run; of a camera, those of keyframes.

    Args:
        past: its journal.
        work: the folder that the journal lies in.
        config: its settings.
        sequence: where the frames are now; None = where they were.

    Raises:
        DatasetError: they are not there.
        ResultsError: no frame came.
    """
    camera = past.header.intrinsics
    if camera is None:
        return open_dataset(sequence or past.header.source, config=config.dataset)
    stamps = [frame.timestamp for frame in _recording(past).frames]
    return KeptFrames(KeptImages(work / KEYFRAMES), Path(past.header.source).stem, camera, stamps)


def _recording(past: JournalContent) -> Recording:
    """The motions of a run in real time; they end where it was killed."""
    if not past.frames:
        raise ResultsError("There is nothing to resume: the run was killed before its first frame was done.")
    seen, first_images = {}, 0
    try:
        for place, record in past.landmarks.items():
            seen[place], first_images = landmarks_of(record)
        frames = tuple(frame_of(record, seen.get(place)) for place, record in enumerate(past.frames))
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError("There is nothing to resume: the journal is none of this version.") from error
    return Recording(frames, (), interrupted=True, checksum=first_images)
