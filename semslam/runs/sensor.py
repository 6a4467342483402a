"""The timing of a camera that states none, from the first seconds of its sequence, before they are tracked."""

from collections.abc import Iterator

from semslam.config import Config
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.camera_times import CameraTimes, TimedSequence
from semslam.datasets.dataset import Dataset
from semslam.errors import FOREIGN, DatasetError
from semslam.frontend.feature_map.odometry import FeatureMapOdometry
from semslam.frontend.prediction import check_frame
from semslam.frontend.sensor.calibration import calibrate
from semslam.frontend.sensor.estimate import Estimate, SensorEstimate
from semslam.plugins import load
from semslam.runs.metrics import SensorMetrics, TimingMetrics
from semslam.types import Frame

FIRST_SECONDS = 8.0
"""How much of a sequence is looked at."""


class CalibratedSequence(TimedSequence):
    """A sequence whose camera has the times that its first seconds determine; the read-out is none where they do not.

    Args:
        dataset: the sequence.
    """

    def __init__(self, dataset: Dataset) -> None:
        self._estimate = calibrate(_first(dataset))
        super().__init__(dataset, CameraTimes.of(self._estimate.applied(CameraSetup(dataset.intrinsics)).intrinsics))

    @property
    def metrics(self) -> SensorMetrics:
        """What was estimated."""
        estimate = self._estimate
        return SensorMetrics(
            readout=_timing(estimate.readout),
            delay=_timing(estimate.delay),
            depth_readout=_timing(estimate.depth_readout),
            used_readout_ms=1000 * self.times.readout,
        )

    @property
    def notes(self) -> list[str]:
        """Notes of the sequence, and what was found."""
        return [*super().notes, _sentence(self._estimate)]


def needs_timing(dataset: Dataset, config: Config) -> bool:
    """Whether the odometry wants a read-out that neither the settings nor the camera state."""
    own = FeatureMapOdometry.name
    reads = own in load("semslam.odometry", config.odometry).reads
    stated = config.section(own, FeatureMapOdometry.Settings).readout
    return reads and stated is None and dataset.intrinsics.readout is None


def _first(dataset: Dataset) -> Iterator[Frame]:
    """The frames of the first seconds that can be used; an error of another kind ends them, and waits for the run."""
    end = dataset.timestamps[0] + FIRST_SECONDS
    for index, timestamp in enumerate(dataset.timestamps):
        if timestamp > end:
            return
        try:
            frame = dataset.frame(index)
            check_frame(frame)
        except DatasetError:
            continue
        except FOREIGN:  # whatever a plug-in or a library raises: the run meets it at the same frame
            return
        yield frame


def _timing(found: Estimate) -> TimingMetrics:
    return TimingMetrics(ms=1000 * found.value, sigma_ms=1000 * found.sigma, determined=found.is_determined)


def _sentence(estimate: SensorEstimate) -> str:
    found = estimate.readout
    if not found.is_better_than(0.0):
        return (
            "The camera states no read-out, and the motion of the first seconds does not determine it: "
            "all rows are taken to be exposed at once (readout in camera.yaml, feature_map.readout)."
        )
    return (
        f"The camera states no read-out: {1000 * found.value:.1f} ms (standard deviation {1000 * found.sigma:.1f} ms) "
        "were estimated from the first seconds."
    )
