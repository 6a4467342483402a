"""The scenes by name: what stands where, and the camera's way through it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from semslam.datasets.synthetic import fittings, furnishing, routes
from semslam.datasets.synthetic.catalog import make_materials
from semslam.datasets.synthetic.rooms import WALL, Room
from semslam.datasets.synthetic.routes import Route
from semslam.datasets.synthetic.scene import Light, Scene
from semslam.datasets.synthetic.shapes import Part, placed

Surfaces = tuple[list[Part], list[Light]]
Corners = tuple[float, float, float, float]
CORRIDOR_NORTH, CORRIDOR_SOUTH = 5.65, 4.05
"""Middle of the walls on both sides of the corridor, y in metres."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A scene that can be asked for.

    Attributes:
        furnish: gives all surfaces and lights for a seed, before or after things were moved.
        route: the camera's way.
        back: the way that goes back where it came from.
        rooms: each room's smallest and largest x and y, (x0, y0, x1, y1) in metres.
    """

    furnish: Callable[[int, bool], Surfaces]
    route: Route
    back: Route
    rooms: tuple[Corners, ...]

    def build(self, seed: int, moved: bool, moving: Sequence[Part] = ()) -> Scene:
        """The whole scene, its materials painted.

        Args:
            seed: of textures, books and small things.
            moved: whether some things stand elsewhere or are gone.
            moving: surfaces that are elsewhere in each frame.
        """
        parts, lights = self.furnish(seed, moved)
        return Scene(parts, make_materials(seed, (part.material for part in (*parts, *moving))), lights, moving)


def _house(seed: int, moved: bool) -> Surfaces:
    parts, lights = _joined(
        (furnishing.living_room(seed, moved), 0.0, 0.0),
        (furnishing.study(seed, moved), 5.4 + WALL, 0.0),
        (furnishing.corridor(seed, moved), 0.0, 4.0 + WALL),
        (furnishing.bedroom(seed, moved), 0.0, 5.6 + WALL),
        (furnishing.kitchen(seed, moved), 4.4 + WALL, 5.6 + WALL),
    )
    for x, y in ((4.3, CORRIDOR_SOUTH), (8.6, CORRIDOR_SOUTH), (3.2, CORRIDOR_NORTH), (5.6, CORRIDOR_NORTH)):
        parts += _frame(x, y)
    parts += _frame(5.45, 3.0, np.pi / 2)
    # Leaves stand open into the rooms: hinge and the direction they point in.
    for x, y, yaw in ((3.83, 3.96, -100), (9.06, 3.96, -85), (3.67, 5.74, 75), (5.13, 5.74, 100)):
        parts += _leaf(x, y, yaw)
    return parts, lights


def _twins(seed: int, moved: bool) -> Surfaces:
    parts, lights = _joined(
        (furnishing.study(seed, moved, archway=False), *routes.TWIN_CORNERS[0]),
        (furnishing.study(seed, moved, archway=False, twin=True), *routes.TWIN_CORNERS[1]),
        (furnishing.corridor(seed, moved), 0.0, 4.0 + WALL),
    )
    for x in (4.3, 8.6):
        parts += _frame(x, CORRIDOR_SOUTH)
    for x in (3.2, 5.6):
        parts += _shut_door(x, CORRIDOR_NORTH)
    return parts, lights


def _room(seed: int, moved: bool) -> Surfaces:
    parts, lights = _joined((furnishing.study(seed, moved, archway=False), 0.0, 0.0))
    return parts + _shut_door(3.1, CORRIDOR_SOUTH), lights


def _frame(x: float, y: float, yaw: float = 0.0) -> list[Part]:
    return placed(fittings.door_frame(*furnishing.DOOR, WALL, "white_wood"), x, y, yaw)


def _leaf(x: float, y: float, degrees: float) -> list[Part]:
    return placed(fittings.door_leaf(0.9, 2.04, "door", "white_wood"), x, y, np.radians(degrees))


def _shut_door(x: float, y: float) -> list[Part]:
    """A frame and a leaf that leaves no gap to look through."""
    return _frame(x, y) + placed(fittings.door_leaf(0.9, 2.08, "door", "white_wood"), x + 0.45, y, np.pi, -0.01)


def _joined(*rooms: tuple[Room, float, float]) -> Surfaces:
    parts: list[Part] = []
    lights: list[Light] = []
    for room, x, y in rooms:
        more, shine = room.built(x, y)
        parts += more
        lights += shine
    return parts, lights


_CORRIDOR: Corners = (0.0, CORRIDOR_SOUTH, 9.6, CORRIDOR_NORTH)
_STUDIES: tuple[Corners, ...] = tuple((x, y, x + 4.1, y + 4.0) for x, y in routes.TWIN_CORNERS)
PLANS = {
    "house": Plan(
        _house,
        routes.HOUSE,
        routes.HOUSE_BACK,
        ((0.0, 0.0, 5.45, CORRIDOR_SOUTH), (5.45, 0.0, 9.6, CORRIDOR_SOUTH), _CORRIDOR,
         (0.0, CORRIDOR_NORTH, 4.45, 9.4), (4.45, CORRIDOR_NORTH, 9.6, 9.4)),
    ),
    "twins": Plan(_twins, routes.TWINS, routes.TWINS_BACK, (*_STUDIES, _CORRIDOR)),
    "room": Plan(_room, routes.ROOM, routes.ROOM_BACK, ((0.0, 0.0, 4.1, 4.0),)),
}  # fmt: skip
"""house: four rooms and a corridor, 9.6 x 9.4 m. twins: two studies that look alike on one corridor. room: a study."""
