"""What becomes of a real sequence that is disturbed: a state and a report, never a wrong pose."""

from pathlib import Path

import pytest

from semslam.config import Config, DatasetConfig, FaultConfig
from semslam.datasets import open_dataset
from semslam.runs.pipeline import RunResult, run
from semslam.types import TrackingStatus

FRAME = 1 / 30
BLACKOUT = FaultConfig(black=((199.5 * FRAME, 259.5 * FRAME),), gaps=((259.5 * FRAME, 399.5 * FRAME),))


def kitchen(shared: Path, detector: str, **dataset: object) -> RunResult:
    settings = DatasetConfig.model_validate(dataset)
    config = Config(detector=detector, dataset=settings)
    return run(open_dataset(shared / "data" / "redkitchen", settings), config)


def error(result: RunResult) -> float:
    """The final ATE in metres."""
    found = result.metrics.optimized.ate_rmse_m
    assert found is not None
    return found


def test_a_camera_that_wakes_up_elsewhere_gets_its_maps_joined_by_loops(shared: Path) -> None:
    """At 10 Hz; the clean sequence has an ATE of 5 cm."""
    result = kitchen(shared, "fused", stride=3, faults=BLACKOUT)
    assert {frame.map_id for frame in result.slam.frames} == {0, 1}
    assert result.metrics.maps == 1
    assert result.metrics.loops.false == 0
    assert error(result) < 1.3 * 0.05


@pytest.mark.parametrize("fault", ["black", "no_depth", "gaps"])
def test_a_short_fault_is_survived(fault: str, shared: Path) -> None:
    result = kitchen(shared, "none", max_frames=150, faults={fault: ((2.0, 2.5),)})
    lost = [frame for frame in result.slam.frames if frame.status is TrackingStatus.LOST]
    assert all(1.9 < frame.timestamp - result.slam.frames[0].timestamp < 2.6 for frame in lost)
    assert len(lost) >= 14 * (fault == "black")
    assert bool(lost) == bool(result.metrics.lost_intervals)
    assert result.metrics.maps == 1
    assert error(result) < 0.06
