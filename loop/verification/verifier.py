"""The role that decides by geometry whether a proposed loop is one."""

from typing import ClassVar, Protocol, Self, runtime_checkable

from semslam.config import Config
from semslam.plugins import load
from semslam.types import Keyframe, LoopCandidate, LoopConstraint, LoopRejection


@runtime_checkable
class LoopVerifier(Protocol):
    """Decides whether two keyframes show the same place, and from where. Deterministic for a seed."""

    name: ClassVar[str]

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Make the verifier from the settings."""

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint | LoopRejection:
        """The relative pose with its covariance, or the first test that failed."""


def build_verifier(config: Config) -> LoopVerifier:
    """The verifier that ``verification.name`` names.

    Raises:
        ConfigError: it is not registered.
    """
    return load("semslam.verifiers", config.verification.name).from_config(config)
