"""KISS-ICP's voxel map of points, and registration of scans to it (Vizzo et al., RA-L 2023)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from semslam.types import FloatArray, Points3, Transform


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """A depth image's points as the map takes them.

    Attributes:
        source: (N, 3) metres, thinned, which are registered.
        kept: (M, 3) metres, less thinned, which the map keeps.
    """

    source: Points3
    kept: Points3


class VoxelMap:
    """Points of past scans, near the newest one.

    Args:
        voxel: metres.
        max_range: metres from the newest scan beyond which points are forgotten.
        threshold: a third of the distance, in metres, up to which points are associated.
    """

    def __init__(self, voxel: float, max_range: float, threshold: float) -> None:
        from kiss_icp.config.parser import KISSConfig
        from kiss_icp.kiss_icp import KissICP

        settings = KISSConfig()
        settings.data.max_range = max_range
        settings.data.deskew = False
        settings.mapping.voxel_size = voxel
        settings.adaptive_threshold.fixed_threshold = threshold
        settings.registration.max_num_threads = 1  # sums in a fixed order
        self._icp: Any = KissICP(settings)
        self._threshold = threshold
        self.is_empty = True

    def scan(self, points: Points3) -> Scan:
        """Thin a depth image's points (N, 3) out."""
        kept = self._icp.preprocessor.preprocess(points, np.zeros(0), np.eye(4))
        source, kept = self._icp.voxelize(kept)
        return Scan(source, kept)

    def locate(self, scan: Scan, T_map_cam: Transform) -> FloatArray:
        """The pose (4, 4) of a scan in the map, from a guess."""
        pose = self._icp.registration.align_points_to_map(
            points=scan.source,
            voxel_map=self._icp.local_map,
            initial_guess=T_map_cam,
            max_correspondance_distance=3 * self._threshold,
            kernel=self._threshold,
        )
        return np.asarray(pose, dtype=np.float64)

    def add(self, scan: Scan, T_map_cam: Transform) -> None:
        """Write a scan into the map."""
        self._icp.local_map.update(scan.kept, T_map_cam)
        self.is_empty = False
