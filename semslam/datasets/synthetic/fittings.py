"""Shelves with books, pictures, lamps, windows, doors and small things."""

import numpy as np

from semslam.datasets.synthetic import labels
from semslam.datasets.synthetic.scene import Light
from semslam.datasets.synthetic.shapes import Part, box, drape, leaf, panel, placed, quad, sheet, soft_box, turned

SPINES = 32
"""Spines on one image of book backs."""


def book_row(rng: np.random.Generator, width: float, height: float, spines: str, cover: str) -> list[Part]:
    """Books side by side from -width/2 on, backs towards +y, some leaning, some lying; stands at z = 0."""
    parts: list[Part] = []
    x = -width / 2 + 0.01
    while True:
        thick = float(rng.uniform(0.022, 0.05))
        tall, deep = float(rng.uniform(0.62, 0.93)) * height, float(rng.uniform(0.15, 0.21))
        index = int(rng.integers(SPINES))
        if x + thick > width / 2 - 0.01:
            return parts
        block = box((0, deep / 2, tall / 2), (thick, deep, tall), cover, labels.BOOKS)
        uv = np.array([[index / SPINES, 0.0], [(index + 1) / SPINES, 1.0]])
        corner = (thick / 2, deep + 0.001, tall)
        back = quad(corner, (-thick, 0, 0), (0, 0, -tall), spines, labels.BOOKS, uv)
        parts += placed([block, back], x + thick / 2, 0.02)
        x += thick + (0.002 if rng.random() < 0.93 else float(rng.uniform(0.05, 0.16)))


def bookcase(
    rng: np.random.Generator, width: float, height: float, wood: str, spines: str, cover: str, props: tuple[str, ...]
) -> list[Part]:
    """An open bookcase: boards, back, a row of books or a few things on each shelf."""
    label, depth, thick = labels.BOOKSHELF, 0.28, 0.024
    shelves = max(2, round(height / 0.36))
    gap = (height - 0.08) / shelves
    parts = [box((x, depth / 2, height / 2), (thick, depth, height), wood, label) for x in (-width / 2, width / 2)]
    parts.append(box((0, 0.008, height / 2), (width, 0.012, height), wood, label))
    levels = [0.06 + k * gap for k in range(shelves + 1)]
    parts += [box((0, depth / 2, z), (width - thick, depth, thick), wood, label) for z in levels]
    for level in levels[:-1]:
        floor = level + thick / 2
        clear = gap - thick
        if rng.random() < 0.75:
            share = float(rng.uniform(0.55, 0.98))
            row = book_row(rng, (width - 0.04) * share, clear, spines, cover)
            parts += placed(row, -(width - 0.04) * (1 - share) / 2, 0.03, 0, floor)
            spare = 0.5 * width - (1 - share) * width / 2
            if share < 0.8:
                parts += placed(trinket(rng, props, clear * 0.8), spare, 0.14, 0, floor)
        else:
            for x in np.linspace(-0.3, 0.3, 3) * width:
                parts += placed(trinket(rng, props, clear * 0.85), float(x), 0.14, 0, floor)
    return parts


def trinket(rng: np.random.Generator, materials: tuple[str, ...], height: float) -> list[Part]:
    """A vase, a bowl, a box or a small plant pot."""
    material = materials[int(rng.integers(len(materials)))]
    tall = height * float(rng.uniform(0.5, 1.0))
    kind = int(rng.integers(3))
    if kind == 0:
        r = min(0.07, tall / 2)
        return [turned([(0.5 * r, 0.0), (r, 0.35 * tall), (0.9 * r, 0.6 * tall), (0.4 * r, 0.85 * tall),
                        (0.5 * r, tall), (0.0, tall)], (0, 0, 0), material, labels.OTHER_PROP, 14)]  # fmt: skip
    if kind == 1:
        size = (float(rng.uniform(0.1, 0.2)), 0.15, tall * 0.7)
        return [box((0, 0, size[2] / 2), size, material, labels.BOX)]
    return [turned([(0.03, 0.0), (0.1, 0.08), (0.11, 0.1), (0.0, 0.07)], (0, 0, 0), material, labels.OTHER_PROP, 16)]


def picture(width: float, height: float, image: str, frame: str) -> list[Part]:
    """A framed picture, its centre at z = 0."""
    label, rim, thick = labels.PICTURE, 0.035, 0.028
    parts = [panel((0, 0.016, 0), width - rim, height - rim, image, label)]
    for side in (-1, 1):
        parts.append(box((side * (width - rim) / 2, thick / 2, 0), (rim, thick, height), frame, label))
        parts.append(box((0, thick / 2, side * (height - rim) / 2), (width, thick, rim), frame, label))
    return parts


def pinned(width: float, height: float, image: str, label: int = labels.PICTURE) -> list[Part]:
    """A poster, a whiteboard or a sheet on a wall, its centre at z = 0."""
    return [panel((0, 0.006, 0), width, height, image, label)]


def window(width: float, height: float, view: str, frame: str, wall: float = 0.12) -> tuple[list[Part], list[Light]]:
    """What fills an opening of the given size, its lower edge at z = 0: pane, bars, reveal, sill; and its light."""
    label, deep = labels.WINDOW, wall * 0.9
    parts = [panel((0, -deep, height / 2), width, height, view, label, spacing=5.0)]
    # The reveal reaches a little into the opening, so that no ray slips out between it and the wall.
    half, bar, jamb = width / 2, -deep + 0.03, width / 2 + 0.015
    parts += [box((x, bar, height / 2), (0.06, 0.05, height), frame, label) for x in (-half, 0.0, half)]
    parts += [box((0, bar, z), (width, 0.045, 0.06), frame, label) for z in (0.0, 0.7 * height, height)]
    parts += [box((x, -deep / 2, height / 2), (0.04, deep, height), frame, label) for x in (-jamb, jamb)]
    parts.append(box((0, -deep / 2, height + 0.015), (width + 0.08, deep, 0.04), frame, label))
    parts.append(box((0, -deep / 2 + 0.05, -0.015), (width + 0.14, deep + 0.1, 0.04), frame, label))
    strength = 2.4 * width * height / 9
    lights = [
        Light(
            (float(x * width), 0.03, float(z * height)), (strength * 0.97, strength, strength * 1.04), (0, 1, 0), "day"
        )
        for x in (-0.33, 0.0, 0.33)
        for z in (0.2, 0.5, 0.8)
    ]
    return parts, lights


def curtains(width: float, height: float, fabric: str, rod: str) -> list[Part]:
    """A pair drawn to the sides of a window, hanging from a rod at z = height."""
    parts = [box((0, 0.1, height + 0.03), (width + 0.9, 0.025, 0.025), rod, labels.CURTAIN)]
    for side in (-1, 1):
        x = side * (width / 2 + 0.18)
        parts.append(drape((x, 0.1, height / 2 + 0.03), 0.5, height - 0.04, fabric, labels.CURTAIN, 5))
    return parts


def blinds(width: float, height: float, material: str) -> list[Part]:
    """Slats over the upper part of a window, hanging from z = height."""
    count = round(height / 0.05)
    slats = [box((0, 0.03, height - 0.05 * k), (width, 0.034, 0.006), material, labels.BLINDS) for k in range(count)]
    return [box((0, 0.03, height + 0.03), (width, 0.05, 0.05), material, labels.BLINDS), *slats]


def floor_lamp(shade: str, metal: str, strength: float = 0.55) -> tuple[list[Part], list[Light]]:
    """A standing lamp with a cloth shade, its foot about (0, 0.2)."""
    parts = [turned([(0.0, 0.03), (0.15, 0.03), (0.15, 0.0)][::-1], (0, 0.2, 0), metal, labels.LAMP)]
    parts.append(turned([(0.014, 0.03), (0.014, 1.5)], (0, 0.2, 0), metal, labels.LAMP, 8))
    parts.append(turned([(0.22, 1.38), (0.15, 1.7), (0.0, 1.7)], (0, 0.2, 0), shade, labels.LAMP, 20))
    return parts, _glow((0.0, 0.2, 1.55), strength)


def table_lamp(shade: str, foot: str, strength: float = 0.3) -> tuple[list[Part], list[Light]]:
    """A bedside lamp standing at z = 0 about (0, 0)."""
    parts = [turned([(0.07, 0.0), (0.075, 0.08), (0.03, 0.16), (0.012, 0.26)], (0, 0, 0), foot, labels.LAMP, 14)]
    parts.append(turned([(0.13, 0.24), (0.09, 0.42), (0.0, 0.42)], (0, 0, 0), shade, labels.LAMP, 18))
    return parts, _glow((0.0, 0.0, 0.34), strength)


def ceiling_lamp(height: float, shade: str, strength: float = 1.5) -> tuple[list[Part], list[Light]]:
    """A flat glass lamp under a ceiling at the given height, about (0, 0)."""
    bowl = [(0.0, height - 0.12), (0.14, height - 0.1), (0.2, height - 0.04), (0.2, height)]
    return [turned(bowl, (0, 0, 0), shade, labels.LAMP, 20)], _glow((0.0, 0.0, height - 0.35), strength)


def _glow(centre: tuple[float, float, float], strength: float) -> list[Light]:
    """Warm light from a few points about a centre, so that shadows are soft."""
    share = strength / 4
    color = (share, share * 0.86, share * 0.66)
    offsets = ((0.12, 0.0), (-0.12, 0.0), (0.0, 0.12), (0.0, -0.12))
    return [Light((centre[0] + dx, centre[1] + dy, centre[2]), color) for dx, dy in offsets]


def door_frame(width: float, height: float, wall: float, material: str) -> list[Part]:
    """Jambs, head and architraves of an opening through a wall of the given thickness, centred at y = 0."""
    parts: list[Part] = []
    for side in (-1, 1):
        parts.append(
            box((side * (width / 2 - 0.015), 0, height / 2), (0.03, wall + 0.02, height), material, labels.DOOR)
        )
        for face in (-1, 1):
            centre = (side * (width / 2 + 0.03), face * (wall / 2 + 0.008), height / 2)
            parts.append(box(centre, (0.08, 0.016, height), material, labels.DOOR))
    parts.append(box((0, 0, height - 0.015), (width, wall + 0.02, 0.03), material, labels.DOOR))
    for face in (-1, 1):
        centre = (0.0, face * (wall / 2 + 0.008), height + 0.03)
        parts.append(box(centre, (width + 0.14, 0.016, 0.08), material, labels.DOOR))
    parts.append(sheet((0, 0, 0.004), width, wall + 0.04, material, labels.FLOOR))
    return parts


def door_leaf(width: float, height: float, image: str, wood: str) -> list[Part]:
    """A leaf in the plane y = 0, hinged at x = 0 and reaching to x = width, with handles on both sides."""
    leaf = box((0, 0, height / 2), (width, 0.036, height - 0.02), wood, labels.DOOR)
    side = [panel((0, 0.019, height / 2), width, height - 0.02, image, labels.DOOR)]
    knobs = [
        soft_box((width / 2 - 0.09, y, 1.02), (0.12, 0.02, 0.022), "metal", labels.DOOR, 0.009) for y in (-0.06, 0.06)
    ]
    return placed([leaf, *side, *placed(side, 0, 0, np.pi), *knobs], width / 2, 0)


def plant(rng: np.random.Generator, pot: str, foliage: str, height: float) -> list[Part]:
    """A pot with a bush of crossed leaves, about (0, 0.2)."""
    parts = [turned([(0.11, 0.0), (0.16, 0.28), (0.0, 0.26)], (0, 0.2, 0), pot, labels.OTHER_PROP)]
    for _ in range(34):
        length = float(rng.uniform(0.2, 0.42))
        blade = leaf(length, 0.3 * length, float(rng.uniform(0.1, 0.5)), foliage, labels.OTHER_PROP)
        parts += placed([blade], 0, 0.2, float(rng.uniform(0, 2 * np.pi)), 0.27 + float(rng.uniform(0, height - 0.4)))
    stalk = [(0.015, 0.2), (0.008, height)]
    return [*parts, turned(stalk, (0, 0.2, 0), foliage, labels.OTHER_PROP, 6)]


def carton_box(width: float, depth: float, height: float, image: str) -> list[Part]:
    """A cardboard box with its print on all sides."""
    parts = [panel((0, depth, height / 2), width, height, image, labels.BOX)]
    parts += placed([panel((0, 0, height / 2), width, height, image, labels.BOX)], 0, 0, np.pi)
    parts += placed([panel((0, width / 2, height / 2), depth, height, image, labels.BOX)], 0, depth / 2, np.pi / 2)
    parts += placed([panel((0, width / 2, height / 2), depth, height, image, labels.BOX)], 0, depth / 2, -np.pi / 2)
    return [*parts, sheet((0, depth / 2, height), width, depth, image, labels.BOX)]
