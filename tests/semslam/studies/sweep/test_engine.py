"""In which order runs are made, and what happens where one fails."""

from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from pathlib import Path

from semslam.config import Config
from semslam.runs.metrics import LoopMetrics, Metrics, TimeMetrics, TrajectoryMetrics
from semslam.studies.sweep.engine import run_jobs
from semslam.studies.sweep.plan import Job, plan_jobs
from semslam.studies.sweep.suite import make_suite
from semslam.studies.sweep.summary import summarise_suite
from semslam.studies.sweep.work import Outcome

ERRORS = {"none": 0.10, "semantic": 0.04, "fused": 0.03}


def metrics(job: Job, ate: float) -> Metrics:
    errors = TrajectoryMetrics(ate_rmse_m=ate, ate_sim3_rmse_m=ate, ate_max_m=ate, pairs=9)
    return Metrics(
        sequence=job.case.sequence, detector=job.case.detector, odometry=job.case.odometry, seed=job.case.seed,
        frames=10, unreadable=0, tracked=9, lost_intervals=[], keyframes=3, ground_truth_coverage=0.5,
        odometry_only=errors, optimized=errors, maps=1,
        loops=LoopMetrics(proposed=3, verified=2, accepted=2, true=2, inaccurate=0, false=0),
        time=TimeMetrics(wall_s=1, fps=1, cpu_s=1, peak_mb=1, stages_ms={}),
    )  # fmt: skip


@dataclass
class FakeCrew:
    """Makes runs up; some fail, some kill their process so many times."""

    failing: tuple[str, ...] = ()
    deadly: dict[str, int] = field(default_factory=dict)
    made: list[tuple[str, int, bool]] = field(default_factory=list)

    def submit(self, job: Job) -> "Future[Outcome]":
        detector, future = job.case.detector, Future[Outcome]()
        self.made.append((detector, job.case.seed, job.recording is not None))
        if self.deadly.get(detector, 0):
            self.deadly[detector] -= 1
            future.set_exception(RuntimeError("a process died"))
        elif detector in self.failing:
            future.set_result(Outcome(job.case, None, "It failed."))
        else:
            future.set_result(Outcome(job.case, metrics(job, ERRORS[detector] + 0.01 * job.case.seed)))
        return future


def jobs(tmp_path: Path, seeds: tuple[int, ...] = (0, 1)) -> list[Job]:
    values = {"sequences": ["synthetic:room"], "detectors": list(ERRORS), "seeds": list(seeds)}
    return plan_jobs(make_suite(values, "The suite"), Config(), tmp_path, tmp_path)


def test_one_run_tracks_and_the_others_use_its_front_end(tmp_path: Path) -> None:
    crew, plan = FakeCrew(), jobs(tmp_path)
    outcomes = run_jobs(plan, crew)
    assert [outcome.case for outcome in outcomes] == [job.case for job in plan]
    assert sorted(crew.made) == sorted((name, seed, name != "none") for name in ERRORS for seed in (0, 1))


def test_where_the_first_fails_the_next_one_tracks(tmp_path: Path) -> None:
    crew = FakeCrew(failing=("none",))
    outcomes = run_jobs(jobs(tmp_path, (0,)), crew)
    assert crew.made == [("none", 0, False), ("semantic", 0, False), ("fused", 0, True)]
    assert [outcome.failure for outcome in outcomes] == ["It failed.", "", ""]


def test_a_run_that_kills_its_process_twice_has_failed_and_the_others_have_not(tmp_path: Path) -> None:
    crew = FakeCrew(deadly={"semantic": 9, "fused": 1})
    outcomes = run_jobs(jobs(tmp_path, (0,)), crew)
    assert [bool(outcome.failure) for outcome in outcomes] == [False, True, False]
    assert "died" in outcomes[1].failure


def test_the_summary_pairs_each_run_with_the_one_without_loops(tmp_path: Path) -> None:
    plan = jobs(tmp_path)
    rows = {row.method.detector: row for row in summarise_suite(run_jobs(plan, FakeCrew()))}
    fused = rows["fused"]
    assert fused.ate_m is not None
    assert fused.change_m is not None
    assert (fused.runs, fused.failed, fused.tracked, fused.coverage) == (2, 0, 0.9, 0.5)
    assert round(fused.ate_m.mean, 6) == 0.035
    assert round(fused.change_m.mean, 6) == -0.07
    assert fused.change_m.spread is not None
    assert fused.change_m.spread < 1e-9, "what the seeds have in common falls out of the difference"
    assert rows["none"].change_m is None
    assert fused.loops.true == 4


def test_several_sequences_are_averaged_unless_one_failed_throughout(tmp_path: Path) -> None:
    values = {"sequences": ["synthetic:room", "synthetic:house"], "detectors": ["none", "fused"]}
    plan = plan_jobs(make_suite(values, "The suite"), Config(), tmp_path, tmp_path)
    outcomes = run_jobs(plan, FakeCrew())
    assert [row.method.detector for row in summarise_suite(outcomes) if row.sequence == "all sequences"] == [
        "none",
        "fused",
    ]
    outcomes[-1] = replace(outcomes[-1], metrics=None, failure="It failed.")
    assert [row.method.detector for row in summarise_suite(outcomes) if row.sequence == "all sequences"] == ["none"]
