"""Every registered robust strategy keeps the contract."""

import pytest

from semslam import plugins
from semslam.testing import RobustContract

SOFT = {"cauchy", "huber"}
"""Their weights fall with the residual, but not to 0."""


class TestRobustStrategy(RobustContract):
    @pytest.fixture(autouse=True, params=plugins.names("semslam.robust"))
    def choose(self, request: pytest.FixtureRequest) -> None:
        self.implementation = plugins.load("semslam.robust", request.param)
        self.rejects = request.param not in SOFT
        assert self.implementation.name == request.param
