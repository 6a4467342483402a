"""The shell of a room and the placing of things in it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from semslam.datasets.synthetic import labels
from semslam.datasets.synthetic.scene import Light
from semslam.datasets.synthetic.shapes import Part, box, placed, quad
from semslam.geometry.se3 import exp_so3

WALL = 0.1
"""Metres between two rooms."""
HEIGHT = 2.6
_YAW = {"S": 0.0, "N": np.pi, "W": -np.pi / 2, "E": np.pi / 2}


@dataclass(frozen=True, slots=True)
class Opening:
    """A door or a window in a wall.

    Attributes:
        side: "S", "N", "W" or "E".
        along: metres of its centre, in x for S and N, in y for W and E.
        width: metres.
        bottom: metres.
        top: metres.
    """

    side: str
    along: float
    width: float
    bottom: float
    top: float


class Room:
    """A rectangular room with its corner at (0, 0), to be filled; ``built`` gives what it became.

    Args:
        width: metres along x.
        depth: metres along y.
    """

    def __init__(self, width: float, depth: float) -> None:
        self.width = width
        self.depth = depth
        self.parts: list[Part] = []
        self.lights: list[Light] = []

    def shell(self, wall: str, floor: str, openings: Sequence[Opening], accent: dict[str, str] | None = None) -> None:
        """Floor, ceiling, and walls with openings and skirting; ``accent`` gives sides another material."""
        w, d = self.width, self.depth
        self.parts.append(quad((0, d, 0), (w, 0, 0), (0, -d, 0), floor, labels.FLOOR, spacing=0.15))
        self.parts.append(quad((0, 0, HEIGHT), (w, 0, 0), (0, d, 0), "ceiling", labels.CEILING))
        for side in _YAW:
            length = w if side in "SN" else d
            holes = [o for o in openings if o.side == side]
            material = (accent or {}).get(side, wall)
            self.against(side, length / 2, self._wall(length, material, [self._local(o) for o in holes]))

    def against(self, side: str, along: float, parts: Iterable[Part], lights: Iterable[Light] = (), out: float = 0.0,
                z: float = 0.0) -> None:  # fmt: skip
        """Put a thing with its back to a wall, ``out`` metres off it and ``z`` above the floor."""
        x, y = {"S": (along, out), "N": (along, self.depth - out), "W": (out, along), "E": (self.width - out, along)}[
            side
        ]
        self.stand(x, y, parts, lights, np.degrees(_YAW[side]), z)

    def stand(self, x: float, y: float, parts: Iterable[Part], lights: Iterable[Light] = (), yaw: float = 0.0,
              z: float = 0.0) -> None:  # fmt: skip
        """Put a thing anywhere; ``yaw`` in degrees turns its front from +y."""
        self.parts += placed(parts, x, y, np.radians(yaw), z)
        self.lights += [_moved(light, x, y, z, np.radians(yaw)) for light in lights]

    def built(self, x: float, y: float) -> tuple[list[Part], list[Light]]:
        """All parts and lights with the room's corner at (x, y)."""
        return placed(self.parts, x, y), [_moved(light, x, y, 0.0, 0.0) for light in self.lights]

    def _local(self, hole: Opening) -> Opening:
        half = (self.width if hole.side in "SN" else self.depth) / 2
        sign = 1 if hole.side in "SE" else -1
        return replace(hole, along=sign * (hole.along - half))

    @staticmethod
    def _wall(length: float, material: str, holes: Sequence[Opening]) -> list[Part]:
        xs = {-length / 2, length / 2}
        for hole in holes:
            xs |= {hole.along - hole.width / 2, hole.along + hole.width / 2}
        stops = sorted(xs)
        parts = []
        for left, right in pairwise(stops):
            middle = (left + right) / 2
            cut = [o for o in holes if abs(o.along - middle) < o.width / 2]
            spans = [(0.0, cut[0].bottom), (cut[0].top, HEIGHT)] if cut else [(0.0, HEIGHT)]
            for low, high in spans:
                if high - low < 1e-6:
                    continue
                uv = np.array([[-right, -high], [-left, -low]])
                corner, along = (right, 0, high), (left - right, 0, 0)
                parts.append(quad(corner, along, (0, 0, low - high), material, labels.WALL, uv, spacing=0.16))
            if not cut or cut[0].bottom > 0:
                parts.append(box((middle, 0.008, 0.045), (right - left, 0.016, 0.09), "white_wood", labels.WALL))
        return parts


def _moved(light: Light, x: float, y: float, z: float, yaw: float) -> Light:
    R = exp_so3((0.0, 0.0, yaw))
    px, py, pz = (float(c) for c in R @ light.position + (x, y, z))
    if light.normal is None:
        return replace(light, position=(px, py, pz))
    nx, ny, nz = (float(c) for c in R @ light.normal)
    return replace(light, position=(px, py, pz), normal=(nx, ny, nz))
