"""Every registered loop verifier keeps the contract."""

import pytest

from semslam import plugins
from semslam.testing import VerifierContract


class TestVerifier(VerifierContract):
    @pytest.fixture(autouse=True, params=plugins.names("semslam.verifiers"))
    def choose(self, request: pytest.FixtureRequest) -> None:
        self.implementation = plugins.load("semslam.verifiers", request.param)
        assert self.implementation.name == request.param
