"""Robust kernels on the loops' residuals: dynamic covariance scaling, Cauchy and Huber."""

from abc import ABC, abstractmethod
from typing import ClassVar, Self

import gtsam
import numpy as np

from semslam.backend.graph.factors import between_factor
from semslam.backend.robust.least_squares import iterate
from semslam.backend.robust.strategy import RobustProblem, RobustSolution
from semslam.backend.steps import Steps
from semslam.config import BackendConfig

Kernel = gtsam.noiseModel.mEstimator.DCS | gtsam.noiseModel.mEstimator.Cauchy | gtsam.noiseModel.mEstimator.Huber

DCS_PHI = 10.0
"""With the literature's value of 1, true loops are rejected once odometry has drifted."""
CAUCHY_K = 1.0
HUBER_K = 1.345


class _KernelStrategy(ABC):
    """Iteratively reweighted least squares: a loop's weight is the kernel's at its residual."""

    name: ClassVar[str]
    accepts_all: ClassVar[bool] = False

    @classmethod
    def from_config(cls, config: BackendConfig) -> Self:
        """Take no settings."""
        return cls()

    @abstractmethod
    def kernel(self) -> Kernel:
        """A fresh kernel."""

    def solve(self, problem: RobustProblem) -> Steps[RobustSolution]:
        """Loops with weights between 0 and 1."""
        kernel = self.kernel()
        graph = gtsam.NonlinearFactorGraph(problem.trusted)
        for edge in problem.loops:
            graph.add(between_factor(edge, kernel))
        values = yield from iterate(graph, problem.initial, problem.max_iterations)
        residuals = np.sqrt(problem.squared_residuals(values))
        return RobustSolution(values, np.array([kernel.weight(residual) for residual in residuals]))


class DynamicCovarianceScaling(_KernelStrategy):
    """Dynamic covariance scaling (Agarwal et al., ICRA 2013)."""

    name = "dcs"

    def kernel(self) -> Kernel:
        """DCS with phi = 10."""
        return gtsam.noiseModel.mEstimator.DCS.Create(DCS_PHI)


class CauchyKernel(_KernelStrategy):
    """Cauchy's M-estimator."""

    name = "cauchy"

    def kernel(self) -> Kernel:
        """Cauchy with k = 1."""
        return gtsam.noiseModel.mEstimator.Cauchy.Create(CAUCHY_K)


class HuberKernel(_KernelStrategy):
    """Huber's M-estimator."""

    name = "huber"

    def kernel(self) -> Kernel:
        """Huber with k = 1.345."""
        return gtsam.noiseModel.mEstimator.Huber.Create(HUBER_K)
