"""Floor plans and the camera's way through them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semslam.datasets.synthetic import fittings, house
from semslam.datasets.synthetic.catalog import make_materials
from semslam.datasets.synthetic.rooms import WALL, Room
from semslam.datasets.synthetic.scene import Light, Scene, Stop
from semslam.datasets.synthetic.shapes import Part, placed

HOUSE_WAY = (
    Stop(3.3, 2.6, 185), Stop(2.85, 2.4, 222), Stop(2.9, 1.5, 268), Stop(3.3, 1.6, 320), Stop(3.9, 2.5, 358),
    Stop(4.7, 2.95, 360), Stop(5.5, 3.0, 350), Stop(6.2, 2.9, 318), Stop(6.9, 2.5, 284), Stop(7.1, 2.4, 340),
    Stop(7.3, 2.6, 400), Stop(8.1, 3.1, 446), Stop(8.6, 3.7, 450), Stop(8.6, 4.5, 462), Stop(8.3, 4.85, 530),
    Stop(7.4, 4.85, 540), Stop(6.3, 4.85, 532), Stop(5.7, 5.1, 470), Stop(5.6, 5.7, 450), Stop(5.65, 6.5, 420),
    Stop(6.0, 7.4, 395), Stop(6.8, 8.05, 350), Stop(7.4, 8.1, 300), Stop(6.9, 8.05, 230), Stop(6.0, 7.6, 196),
    Stop(5.65, 6.7, 255), Stop(5.6, 5.8, 270), Stop(5.5, 5.1, 230), Stop(4.9, 4.85, 182), Stop(3.9, 4.85, 160),
    Stop(3.3, 5.1, 104), Stop(3.2, 5.8, 92), Stop(3.15, 6.4, 120), Stop(3.0, 7.0, 160), Stop(3.0, 7.5, 186),
    Stop(2.9, 7.7, 222), Stop(2.75, 7.5, 250), Stop(2.85, 7.0, 268), Stop(3.2, 6.3, 276), Stop(3.2, 5.6, 272),
    Stop(3.45, 4.95, 310), Stop(4.05, 4.75, 294), Stop(4.3, 4.1, 270), Stop(4.25, 3.4, 248), Stop(3.8, 2.9, 210),
    Stop(3.3, 2.6, 185),
)  # fmt: skip

STUDY_TOUR = (
    Stop(3.1, 3.3, 250), Stop(2.5, 2.7, 232), Stop(1.9, 2.5, 262), Stop(1.8, 2.3, 300), Stop(1.9, 2.3, 345),
    Stop(2.2, 2.5, 395), Stop(2.8, 3.0, 440), Stop(3.1, 3.5, 450),
)  # fmt: skip


def make_house(seed: int, moved: bool) -> Scene:
    """Four rooms and a corridor, 9.6 x 9.4 m; the way passes all and starts again to the kitchen."""
    parts, lights = _joined(
        (house.living_room(seed, moved), 0.0, 0.0),
        (house.study(seed, moved), 5.4 + WALL, 0.0),
        (house.corridor(seed, moved), 0.0, 4.0 + WALL),
        (house.bedroom(seed, moved), 0.0, 5.6 + WALL),
        (house.kitchen(seed, moved), 4.4 + WALL, 5.6 + WALL),
    )
    for x, y in ((4.3, 4.05), (8.6, 4.05), (3.2, 5.65), (5.6, 5.65)):
        parts += placed(fittings.door_frame(*house.DOOR, WALL, "white_wood"), x, y)
    parts += placed(fittings.door_frame(*house.DOOR, WALL, "white_wood"), 5.45, 3.0, np.pi / 2)
    # Leaves stand open into the rooms: hinge and the direction they point in.
    for x, y, yaw in ((3.83, 3.96, -100), (9.06, 3.96, -85), (3.67, 5.74, 75), (5.13, 5.74, 100)):
        parts += placed(fittings.door_leaf(0.9, 2.04, "door", "white_wood"), x, y, np.radians(yaw))
    return Scene(parts, make_materials(seed), lights, HOUSE_WAY, 23)


def make_twins(seed: int, moved: bool) -> Scene:
    """Two studies with the same furniture, an office chair and a box apart, on one corridor: bait for false loops."""
    parts, lights = _joined(
        (house.study(seed, moved, archway=False), 1.2, 0.0),
        (house.study(seed, not moved, archway=False), 5.4 + WALL, 0.0),
        (house.corridor(seed, moved), 0.0, 4.0 + WALL),
    )
    for x in (4.3, 8.6):
        parts += placed(fittings.door_frame(*house.DOOR, WALL, "white_wood"), x, 4.05)
    for x in (3.2, 5.6):
        parts += placed(fittings.door_frame(*house.DOOR, WALL, "white_wood"), x, 5.65)
        parts += placed(fittings.door_leaf(0.9, 2.04, "door", "white_wood"), x + 0.45, 5.65, np.pi)
    first, second = _shifted(STUDY_TOUR, 1.2, 0.0), _shifted(STUDY_TOUR, 5.4 + WALL, 0.0)
    there = (Stop(4.35, 4.85, 410), Stop(6.4, 4.9, 360), Stop(8.2, 4.85, 320), Stop(8.6, 4.2, 270))
    back = (Stop(8.5, 4.85, 500), Stop(6.4, 4.9, 540), Stop(4.7, 4.85, 590), Stop(4.3, 4.2, 625))
    home = Stop(first[0].x, first[0].y, first[0].yaw + 360, first[0].pitch)
    return Scene(parts, make_materials(seed), lights, (*first, *there, *second, *back, home), len(STUDY_TOUR))


def _shifted(stops: Sequence[Stop], x: float, y: float) -> tuple[Stop, ...]:
    return tuple(replace(stop, x=stop.x + x, y=stop.y + y) for stop in stops)


def _joined(*rooms: tuple[Room, float, float]) -> tuple[list[Part], list[Light]]:
    parts: list[Part] = []
    lights: list[Light] = []
    for room, x, y in rooms:
        more, shine = room.built(x, y)
        parts += more
        lights += shine
    return parts, lights
