"""Triangle shapes with texture coordinates: boxes, soft boxes, turned bodies, panels, drapes.

A part lives in the frame of its piece of furniture: z up, back against y = 0, front towards +y.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import FloatArray, exp_so3

Vector = Sequence[float] | FloatArray
SPACING = 0.22
"""Maximum distance between vertices in metres, so that light baked at them shows soft shadows."""
WHOLE = np.array([[0.0, 0.0], [1.0, 1.0]])
"""Texture coordinates that show an image once."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """One textured surface.

    Attributes:
        vertices: (V, 3) metres.
        normals: (V, 3) unit, outward.
        uvs: (V, 2) metres along the surface, or 0..1 for a material that shows one thing whole.
        triangles: (T, 3) int64 vertex indices, counter-clockwise from outside.
        material: name of its material.
        label: NYU40 class id.
    """

    vertices: FloatArray
    normals: FloatArray
    uvs: FloatArray
    triangles: npt.NDArray[np.int64]
    material: str
    label: int

    def moved(self, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> "Part":
        """The part turned by ``yaw`` radians about z, then shifted, metres."""
        R = exp_so3((0.0, 0.0, yaw))
        return replace(self, vertices=self.vertices @ R.T + (x, y, z), normals=self.normals @ R.T)


def placed(parts: Iterable[Part], x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> list[Part]:
    """All parts of a piece of furniture, put somewhere."""
    return [part.moved(x, y, z, yaw) for part in parts]


def _lattice(rows: int, columns: int) -> npt.NDArray[np.int64]:
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    a, b, c, d = corner, corner + 1, corner + columns + 1, corner + columns
    return np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])


def _joined(pieces: Sequence[Part]) -> Part:
    offsets = np.cumsum([0] + [len(p.vertices) for p in pieces[:-1]])
    triangles = np.concatenate([p.triangles + o for p, o in zip(pieces, offsets, strict=True)])
    vertices = np.concatenate([p.vertices for p in pieces])
    normals = np.concatenate([p.normals for p in pieces])
    uvs = np.concatenate([p.uvs for p in pieces])
    return Part(vertices, normals, uvs, triangles, pieces[0].material, pieces[0].label)


def quad(
    corner: Vector, along_u: Vector, along_v: Vector, material: str, label: int,
    uv: FloatArray | None = None, spacing: float = SPACING,
) -> Part:  # fmt: skip
    """A flat rectangle, seen from outside as an image is: u to the right, v down.

    Args:
        corner: (3,) where u = v = 0.
        along_u: (3,) edge.
        along_v: (3,) edge.
        material: name.
        label: NYU40 id.
        uv: (2, 2) texture coordinates at the corner and opposite to it; metres along the edges where None.
        spacing: maximum distance between vertices, metres.
    """
    eu, ev = np.asarray(along_u, dtype=np.float64), np.asarray(along_v, dtype=np.float64)
    lengths = np.linalg.norm(eu), np.linalg.norm(ev)
    columns, rows = (max(2, int(np.ceil(length / spacing)) + 1) for length in lengths)
    s, t = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    s, t = s.ravel()[:, None], t.ravel()[:, None]
    vertices = np.asarray(corner) + s * eu + t * ev
    normal = np.cross(ev, eu)
    normals = np.tile(normal / np.linalg.norm(normal), (len(vertices), 1))
    low, high = uv if uv is not None else (np.zeros(2), np.array(lengths))
    uvs = low + np.hstack([s, t]) * (high - low)
    return Part(vertices, normals, uvs, _lattice(rows, columns)[:, ::-1], material, label)


def _face(centre: FloatArray, half: FloatArray, axis: int, side: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Corner and edges of one face of a box, u along the longer edge."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    if side > 0:
        i, j = j, i
    eu, ev, corner = np.zeros(3), np.zeros(3), centre - half
    corner[axis] = centre[axis] + side * half[axis]
    eu[i], ev[j] = 2 * half[i], 2 * half[j]
    if half[j] > half[i]:
        corner, eu, ev = corner + eu, ev, -eu
    return corner, eu, ev


def box(centre: Vector, size: Vector, material: str, label: int) -> Part:
    """A box; the texture's u runs along the longer edge of each face, starting at a place of its own."""
    middle, half = np.asarray(centre, dtype=np.float64), np.asarray(size, dtype=np.float64) / 2
    start = np.array([middle @ (3.1, 5.7, 2.3), middle @ (4.3, 1.9, 6.1)]) + half[:2]
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            corner, eu, ev = _face(middle, half, axis, side)
            lengths = np.array([np.linalg.norm(eu), np.linalg.norm(ev)])
            shift = start + 0.37 * (2 * axis + side)
            faces.append(quad(corner, eu, ev, material, label, np.stack([shift, shift + lengths])))
    return _joined(faces)


def soft_box(centre: Vector, size: Vector, material: str, label: int, radius: float = 0.05, bulge: float = 0.0) -> Part:
    """A box with rounded edges, its faces bulging outwards by ``bulge`` metres, as a cushion's do."""
    middle, half = np.asarray(centre, dtype=np.float64), np.asarray(size, dtype=np.float64) / 2
    r = min(radius, 0.95 * float(half.min()))
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            ticks = []
            for k in ((axis + 1) % 3, (axis + 2) % 3):
                inner = half[k] - r
                steps = np.linspace(-inner, inner, max(4, int(np.ceil(2 * inner / SPACING)) + 1))
                ticks.append(np.concatenate([[-half[k], -inner - 0.5 * r], steps, [inner + 0.5 * r, half[k]]]))
            a, b = np.meshgrid(*ticks)
            points = np.empty((a.size, 3))
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = a.ravel(), b.ravel()
            points[:, axis] = side * half[axis]
            inside = np.clip(points, -(half - r), half - r)
            normals = points - inside
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            swell = (1 - (a / half[(axis + 1) % 3]) ** 2) * (1 - (b / half[(axis + 2) % 3]) ** 2)
            vertices = inside + r * normals
            vertices[:, axis] += side * bulge * swell.ravel()
            triangles = _lattice(len(ticks[1]), len(ticks[0]))
            uvs = np.stack([a.ravel(), b.ravel()], -1) + 0.41 * (2 * axis + side) + middle[:2]
            faces.append(
                Part(vertices + middle, normals, uvs, triangles if side > 0 else triangles[:, ::-1], material, label)
            )
    return _joined(faces)


def turned(profile: Sequence[Vector], centre: Vector, material: str, label: int, segments: int = 18) -> Part:
    """A body of revolution about z.

    Args:
        profile: (radius, height) pairs from bottom to top; radius 0 closes an end.
        centre: (3,) of the axis at height 0.
        material: name.
        label: NYU40 id.
        segments: sides around.
    """
    line = np.asarray(profile, dtype=np.float64)
    # Each stretch of the profile has vertices of its own, so that its edges stay sharp.
    angles = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.stack([np.cos(angles), np.sin(angles)], -1)
    length = 0.0
    pieces = []
    for low, high in pairwise(line):
        slope = np.hypot(*(high - low))
        out, up = (high[1] - low[1]) / slope, (low[0] - high[0]) / slope
        vertices, normals, uvs = [], [], []
        for radius, height, along in ((*low, length), (*high, length + slope)):
            vertices.append(np.column_stack([ring * radius, np.full(segments + 1, height)]))
            normals.append(np.column_stack([ring * out, np.full(segments + 1, up)]))
            uvs.append(np.column_stack([angles * max(line[:, 0]), np.full(segments + 1, along)]))
        length += slope
        pieces.append(
            Part(
                np.concatenate(vertices) + np.asarray(centre),
                np.concatenate(normals),
                np.concatenate(uvs),
                _lattice(2, segments + 1),
                material,
                label,
            )
        )
    return _joined(pieces)


def panel(centre: Vector, width: float, height: float, material: str, label: int, spacing: float = SPACING) -> Part:
    """An upright picture facing +y whose material is shown whole."""
    x, y, z = centre
    corner = (x + width / 2, y, z + height / 2)
    return quad(corner, (-width, 0, 0), (0, 0, -height), material, label, WHOLE, spacing)


def sheet(centre: Vector, width: float, depth: float, material: str, label: int, spacing: float = SPACING) -> Part:
    """A flat picture facing up (a rug, a paper) whose material is shown whole; its top is towards +y."""
    x, y, z = centre
    corner = (x - width / 2, y + depth / 2, z)
    return quad(corner, (width, 0, 0), (0, -depth, 0), material, label, WHOLE, spacing)


def drape(centre: Vector, width: float, height: float, material: str, label: int, folds: int) -> Part:
    """A hanging curtain facing +y, in sine folds."""
    amplitude = 0.035
    columns, rows = 8 * folds + 1, 6
    s, t = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    phase = 2 * np.pi * folds * s
    vertices = np.stack([width * (0.5 - s), amplitude * np.sin(phase), height * (0.5 - t)], -1).reshape(-1, 3)
    slope = amplitude * np.cos(phase) * 2 * np.pi * folds / width
    normals = np.stack([slope, np.ones_like(s), np.zeros_like(s)], -1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uvs = np.stack([s * width * 1.6, t * height], -1).reshape(-1, 2)
    return Part(vertices + np.asarray(centre), normals, uvs, _lattice(rows, columns)[:, ::-1], material, label)


def leaf(length: float, width: float, rise: float, material: str, label: int) -> Part:
    """A leaf that grows from the origin along +x, rises and hangs over; it is seen from both sides."""
    s = np.linspace(0.0, 1.0, 7)
    height = length * (rise + 0.5) * 2.4 * (s - s**2)
    half = 0.5 * width * np.sin(np.pi * (0.06 + 0.94 * s)) ** 0.8
    edges = [np.stack([length * s, side * half, height], -1) for side in (-1, 1)]
    slope = (rise + 0.5) * 2.4 * (1 - 2 * s)
    normals = np.stack([-slope, np.zeros_like(s), np.ones_like(s)], -1)
    normals = np.tile(normals / np.linalg.norm(normals, axis=1, keepdims=True), (2, 1))
    vertices = np.concatenate(edges)
    triangles = _lattice(2, len(s))
    upper = Part(vertices, normals, vertices[:, :2].copy(), triangles, material, label)
    # The underside lies a little lower, or rays could not choose.
    lower = replace(upper, vertices=vertices - 1e-3 * normals, normals=-normals, triangles=triangles[:, ::-1])
    return _joined([upper, lower])
