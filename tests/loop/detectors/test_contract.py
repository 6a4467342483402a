"""Every registered loop detector keeps the contract, the example of an outside one included."""

import pytest

from semslam import plugins
from semslam.config import Config
from semslam.testing import DetectorContract
from semslam.testing.scenes import place

ANY_SCORE = {"min_score": 0.0}
SINGLE_VIEWS = {"min_objects": 0, "min_keyframes": 1}
"""The contract's places are one view each of little."""


class TestDetector(DetectorContract):
    @pytest.fixture(autouse=True, params=[*plugins.names("semslam.detectors"), "example_plugin"])
    def choose(self, request: pytest.FixtureRequest) -> None:
        outside = request.param == "example_plugin"
        name = str(request.getfixturevalue("example_plugin") if outside else request.param)
        self.implementation = plugins.load("semslam.detectors", name)
        self.proposes = name != "none"
        self.config = Config().with_changes(loops=ANY_SCORE, objects=SINGLE_VIEWS)
        assert self.implementation.name == name


def test_the_example_takes_its_settings(example_plugin: str) -> None:
    kind = plugins.load("semslam.detectors", example_plugin)
    fine = kind.from_config(Config().with_changes(loops=ANY_SCORE))
    coarse = kind.from_config(Config().with_changes(loops=ANY_SCORE, **{example_plugin: {"bins": 2}}))
    for detector in (coarse, fine):
        detector.add(place(0, 0))
    assert coarse.query(place(9, 1))[0].score > fine.query(place(9, 1))[0].score
