"""What a suite asks for, and which runs share a front end."""

from pathlib import Path

import pytest

from semslam.config import Config
from semslam.errors import ConfigError
from semslam.studies.sweep.plan import find_sequence, group_by_front_end, plan_jobs
from semslam.studies.sweep.suite import make_suite, read_suite, shipped_suites

BASE = Config()


def suite(**values: object):
    return make_suite({"sequences": ["synthetic:room"], "detectors": ["semantic", "none"]} | values, "The suite")


def test_every_combination_is_planned_once(tmp_path: Path) -> None:
    chosen = suite(odometries=["dense", "kiss"], seeds=[0, 1], starts=[0, 4], settings={"a": {}, "b": {"seed": 3}})
    jobs = plan_jobs(chosen, BASE, tmp_path, tmp_path)
    assert len(jobs) == len({job.case for job in jobs}) == len({job.directory for job in jobs}) == 32
    assert {job.config.dataset.start for job in jobs} == {0, 4}


def test_runs_that_track_alike_share_a_front_end_and_the_one_without_loops_goes_first(tmp_path: Path) -> None:
    settings = {"gnc": {}, "dcs": {"backend": {"robust": "dcs"}}, "dense keyframes": {"keyframes": {"interval": 0.2}}}
    groups = group_by_front_end(plan_jobs(suite(settings=settings), BASE, tmp_path, tmp_path))
    assert [[(job.case.settings, job.case.detector) for job in group] for group in groups] == [
        [("gnc", "none"), ("dcs", "none"), ("gnc", "semantic"), ("dcs", "semantic")],
        [("dense keyframes", "none"), ("dense keyframes", "semantic")],
    ]


def test_seeds_share_the_front_end_of_an_odometry_that_draws_nothing(tmp_path: Path) -> None:
    for odometry, groups in (("kiss", 1), ("feature", 2)):
        chosen = suite(odometries=[odometry], seeds=[0, 1], detectors=["none"])
        assert len(group_by_front_end(plan_jobs(chosen, BASE, tmp_path, tmp_path))) == groups
    rendered = suite(sequences=["synthetic:house?seed={seed}"], odometries=["kiss"], seeds=[0, 1])
    jobs = plan_jobs(rendered, BASE, tmp_path, tmp_path)
    assert {job.source for job in jobs} == {"synthetic:house?seed=0", "synthetic:house?seed=1"}
    assert {job.case.sequence for job in jobs} == {"synthetic:house"}


def test_all_runs_share_one_cache_of_segmentations(tmp_path: Path) -> None:
    jobs = plan_jobs(suite(), BASE, tmp_path, tmp_path)
    assert {job.config.segmentation.cache_dir for job in jobs} == {tmp_path / "labels"}
    own = BASE.with_changes(segmentation={"cache_dir": tmp_path / "mine"})
    assert {job.config.segmentation.cache_dir for job in plan_jobs(suite(), own, tmp_path, tmp_path)} == {
        tmp_path / "mine"
    }


def test_a_sequence_is_found_by_its_short_name(tmp_path: Path) -> None:
    (tmp_path / "rgbd_dataset_freiburg1_desk").mkdir()
    (tmp_path / "kitchen").mkdir()
    assert find_sequence("fr1/desk", tmp_path) == str(tmp_path / "rgbd_dataset_freiburg1_desk")
    assert find_sequence("kitchen", tmp_path) == str(tmp_path / "kitchen")
    assert find_sequence("fr1/xyz", tmp_path) == "fr1/xyz"


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"sequences": []}, "sequences"),
        ({"sequences": ["a", "a"]}, "a stands there twice"),
        ({"detectors": ["semantik"]}, "no loop detector 'semantik'"),
        ({"odometries": ["wheels"]}, "no odometry 'wheels'"),
        ({"seeds": [-1]}, "seeds.0"),
        ({"nonsense": 1}, "nonsense"),
        ({"name": "../../elsewhere"}, "name: a name begins with"),
        ({"name": "/tmp"}, "name: a name begins with"),
        ({"name": "new\nline"}, "name: a name begins with"),
    ],
)
def test_a_mistake_in_a_suite_is_named(values: dict[str, object], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        suite(**values)


@pytest.mark.parametrize("text", ["", "- a", "a: [", "\x00"])
def test_a_file_that_is_no_suite_is_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "suite.yaml").write_text(text)
    with pytest.raises(ConfigError, match="suite"):
        read_suite(str(tmp_path / "suite.yaml"))


@pytest.mark.parametrize("name", shipped_suites())
def test_shipped_suites_are_sound(name: str, tmp_path: Path) -> None:
    chosen = read_suite(name)
    assert chosen.name == name
    assert "none" in chosen.detectors
    names = {sequence.name for sequence in chosen.sequences}
    for mark in chosen.marks:
        assert set(mark.ate_cm) <= names
        assert mark.source
    assert len(plan_jobs(chosen, BASE, tmp_path, tmp_path)) >= len(names)
