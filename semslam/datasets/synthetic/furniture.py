"""Seats, tables, beds and cupboards; each stands with its back against y = 0 and looks towards +y."""

import numpy as np

from semslam.datasets.synthetic import labels
from semslam.datasets.synthetic.shapes import Part, box, panel, placed, soft_box, turned


def legs(width: float, depth: float, height: float, material: str, label: int, thick: float = 0.05) -> list[Part]:
    """Four square legs under a top of the given size."""
    dx, near, far = width / 2 - thick, thick, depth - thick
    places = ((-dx, near), (dx, near), (-dx, far), (dx, far))
    return [box((x, y, height / 2), (thick, thick, height), material, label) for x, y in places]


def table(
    width: float, depth: float, height: float, material: str, label: int = labels.TABLE, thick: float = 0.035
) -> list[Part]:
    """A top on four legs with an apron."""
    top = soft_box((0, depth / 2, height - thick / 2), (width, depth, thick), material, label, radius=0.012)
    apron = box((0, depth / 2, height - thick - 0.04), (width - 0.12, depth - 0.12, 0.08), material, label)
    return [top, apron, *legs(width, depth, height - thick, material, label)]


def chair(material: str, seat: str) -> list[Part]:
    """A dining chair with a cushion and a slatted back; its back is at y = 0, the sitter looks towards +y."""
    parts = legs(0.42, 0.44, 0.44, material, labels.CHAIR, 0.038)
    parts.append(soft_box((0, 0.22, 0.46), (0.44, 0.45, 0.05), seat, labels.CHAIR, 0.02, 0.01))
    parts += [box((x, 0.03, 0.7), (0.038, 0.036, 0.5), material, labels.CHAIR) for x in (-0.19, 0.19)]
    parts += [box((0, 0.03, z), (0.36, 0.022, 0.07), material, labels.CHAIR) for z in (0.62, 0.76, 0.91)]
    return parts


def office_chair(seat: str, frame: str) -> list[Part]:
    """A swivel chair: star foot, column, seat, back and arms."""
    parts = [turned([(0.0, 0.0), (0.29, 0.04), (0.05, 0.1), (0.03, 0.12), (0.03, 0.42)], (0, 0.27, 0), frame,
                    labels.CHAIR, segments=10)]  # fmt: skip
    parts.append(soft_box((0, 0.29, 0.47), (0.5, 0.5, 0.1), seat, labels.CHAIR, 0.045, 0.015))
    parts.append(soft_box((0, 0.05, 0.83), (0.46, 0.09, 0.56), seat, labels.CHAIR, 0.04, 0.015))
    for x in (-0.28, 0.28):
        parts.append(soft_box((x, 0.3, 0.66), (0.06, 0.3, 0.04), frame, labels.CHAIR, 0.02))
        parts.append(box((x, 0.24, 0.55), (0.03, 0.05, 0.2), frame, labels.CHAIR))
    return parts


def sofa(width: float, fabric: str, cushions: tuple[str, ...], wood: str, label: int = labels.SOFA) -> list[Part]:
    """A sofa (or, narrow, an armchair): base, arms, seat and back cushions, throw pillows, short feet."""
    depth, arm = 0.92, 0.17
    inner = width - 2 * arm
    count = max(1, round(inner / 0.65))
    parts = legs(width, depth, 0.1, wood, label)
    parts.append(soft_box((0, depth / 2, 0.21), (width - 0.06, depth - 0.04, 0.24), fabric, label, 0.04))
    parts.append(soft_box((0, 0.11, 0.5), (width - 0.1, 0.22, 0.62), fabric, label, 0.08))
    for side in (-1, 1):
        centre = (side * (width - arm) / 2, depth / 2, 0.36)
        parts.append(soft_box(centre, (arm, depth, 0.54), fabric, label, 0.07))
    for k in range(count):
        x = (k + 0.5) * inner / count - inner / 2
        size = inner / count - 0.012
        parts.append(soft_box((x, 0.57, 0.41), (size, 0.68, 0.17), fabric, label, 0.06, 0.03))
        parts.append(soft_box((x, 0.28, 0.66), (size, 0.2, 0.42), fabric, label, 0.08, 0.04))
    for k, material in enumerate(cushions):
        x = ((k + 0.5) / len(cushions) - 0.5) * inner * 1.1
        pillow = soft_box((0, 0, 0), (0.42, 0.12, 0.4), material, labels.PILLOW, 0.055, 0.03)
        parts += placed([pillow], x, 0.46, 0.25 * (-1) ** k, 0.68)
    return parts


def bed(width: float, frame: str, sheet: str, quilt: str, pillow: str) -> list[Part]:
    """A double bed: headboard, mattress, quilt over its lower part, two pillows and a folded blanket."""
    length = 2.05
    parts = [box((0, 0.03, 0.55), (width + 0.1, 0.06, 1.1), frame, labels.BED)]
    parts.append(box((0, length / 2, 0.2), (width + 0.06, length, 0.2), frame, labels.BED))
    parts += legs(width, length, 0.1, frame, labels.BED, 0.07)
    parts.append(soft_box((0, length / 2 + 0.03, 0.41), (width, length - 0.06, 0.24), sheet, labels.BED, 0.07, 0.01))
    parts.append(soft_box((0, 1.36, 0.46), (width + 0.08, 1.4, 0.24), quilt, labels.BED, 0.08, 0.025))
    parts.append(soft_box((0, 0.76, 0.56), (width + 0.06, 0.3, 0.1), sheet, labels.BED, 0.045, 0.01))
    for side in (-1, 1):
        cushion = soft_box((0, 0, 0), (width * 0.42, 0.42, 0.16), pillow, labels.PILLOW, 0.07, 0.04)
        parts += placed([cushion], side * width * 0.24, 0.33, 0.07 * side, 0.61)
    return parts


def cupboard(
    width: float, depth: float, height: float, front: str, body: str, label: int,
    columns: int = 2, rows: int = 1, handle: str = "metal",
) -> list[Part]:  # fmt: skip
    """A closed cupboard, dresser or night stand: plinth, body, doors or drawers with gaps and handles."""
    parts = [box((0, depth / 2, 0.04), (width - 0.04, depth - 0.06, 0.08), body, label)]
    parts.append(box((0, depth / 2 - 0.01, height / 2 + 0.04), (width, depth - 0.02, height - 0.08), body, label))
    wide, high = width / columns, (height - 0.1) / rows
    for column, row in np.ndindex(columns, rows):
        x, z = (column + 0.5) * wide - width / 2, 0.09 + (row + 0.5) * high
        parts.append(box((x, depth, z), (wide - 0.012, 0.022, high - 0.012), front, label))
        if rows > 1:
            parts.append(box((x, depth + 0.025, z), (0.14, 0.022, 0.018), handle, label))
        else:
            side = 1 if column % 2 == 0 else -1
            parts.append(box((x + side * (wide / 2 - 0.06), depth + 0.025, z), (0.018, 0.022, 0.16), handle, label))
    return parts


def refrigerator(material: str, trim: str) -> list[Part]:
    """A tall fridge with a freezer door."""
    label = labels.REFRIGERATOR
    parts = [box((0, 0.32, 0.92), (0.62, 0.62, 1.8), material, label)]
    for z, height in ((0.38, 0.66), (1.28, 1.08)):
        parts.append(soft_box((0, 0.655, z), (0.61, 0.05, height), material, label, 0.02))
        parts.append(soft_box((-0.25, 0.7, z + 0.2 * np.sign(1 - z)), (0.025, 0.03, 0.32), trim, label, 0.012))
    return parts


def kitchen_unit(width: float, front: str, body: str, top: str, splash: str) -> list[Part]:
    """Base cupboards under a worktop with a sink and a tap, tiled splash-back and wall cupboards above."""
    columns = max(2, round(width / 0.55))
    parts = cupboard(width, 0.58, 0.86, front, body, labels.CABINET, columns)
    parts.append(box((0, 0.305, 0.885), (width, 0.62, 0.04), top, labels.COUNTER))
    parts += placed(
        cupboard(width * 0.62, 0.33, 0.72, front, body, labels.CABINET, columns - 1), -width * 0.18, 0, 0, 1.45
    )
    parts.append(box((0, 0.006, 1.18), (width, 0.012, 0.56), splash, labels.WALL))
    sink = [(0.0, 0.012), (0.17, 0.015), (0.19, 0.025), (0.2, 0.006)]
    parts.append(turned(sink[::-1], (width * 0.28, 0.32, 0.9), "metal", labels.SINK))
    tap = [(0.022, 0.0), (0.018, 0.26), (0.0, 0.27)]
    parts.append(turned(tap, (width * 0.28, 0.1, 0.9), "metal", labels.SINK, 10))
    parts.append(soft_box((width * 0.28, 0.18, 1.16), (0.025, 0.18, 0.025), "metal", labels.SINK, 0.01))
    return parts


def desk(width: float, material: str, metal: str) -> list[Part]:
    """A desk with a drawer unit under its right."""
    parts = table(width, 0.75, 0.74, material, labels.DESK)
    return parts + placed(cupboard(0.4, 0.62, 0.56, material, metal, labels.DESK, 1, 3), width / 2 - 0.28, 0.05)


def monitor(screen: str, body: str, width: float = 0.56) -> list[Part]:
    """A display on a foot, or with its foot hidden a television; stands at z = 0."""
    label = labels.TELEVISION
    height = width * 0.6
    parts = [box((0, 0.1, 0.012), (width * 0.4, 0.2, 0.024), body, label)]
    parts.append(box((0, 0.09, 0.08), (0.06, 0.03, 0.14), body, label))
    parts.append(soft_box((0, 0.11, 0.12 + height / 2), (width, 0.045, height), body, label, 0.012))
    parts.append(panel((0, 0.134, 0.12 + height / 2), width - 0.04, height - 0.04, screen, label))
    return parts
