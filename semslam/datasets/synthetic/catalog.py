"""The materials of all scenes, by name."""

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from semslam.datasets.synthetic import pictures, textures
from semslam.datasets.synthetic.atlas import Material
from semslam.datasets.synthetic.textures import Color, Image

PAINTINGS, POSTERS, SPINES = 18, 8, 3


@dataclass(frozen=True, slots=True)
class _Recipe:
    paint: Callable[[np.random.Generator], Image]
    tile: float = 1.0
    glow: float = 0.0
    lamp: str = "lamps"


WALLS: dict[str, Color] = {
    "wall_living": (226, 216, 196), "wall_study": (186, 204, 206), "wall_corridor": (232, 226, 212),
    "wall_kitchen": (230, 222, 178), "ceiling": (242, 240, 234),
}  # fmt: skip
WOODS: dict[str, Color] = {
    "oak": (176, 132, 84), "walnut": (104, 70, 46), "pine": (206, 168, 118), "dark_wood": (66, 48, 38),
    "cherry": (140, 76, 48),
}  # fmt: skip
BOARDS: dict[str, Color] = {"floor_oak": (172, 128, 84), "floor_dark": (120, 84, 58), "floor_pale": (198, 170, 132)}
CLOTHS: dict[str, Color] = {
    "cloth_blue": (62, 84, 124), "cloth_grey": (128, 126, 124), "cloth_red": (150, 52, 46),
    "cloth_green": (84, 108, 82), "cloth_beige": (196, 178, 150), "cloth_black": (52, 52, 56),
    "linen": (226, 222, 214),
}  # fmt: skip
PRINTS: dict[str, tuple[Color, Color]] = {
    "quilt": ((112, 132, 160), (214, 206, 186)), "cushion_a": ((206, 152, 62), (240, 226, 190)),
    "cushion_b": ((222, 214, 196), (122, 64, 60)), "curtain_living": ((178, 96, 70), (214, 160, 120)),
    "curtain_bedroom": ((120, 134, 160), (186, 190, 200)),
}  # fmt: skip
RUGS: dict[str, tuple[Color, Color, Color]] = {
    "rug_living": ((150, 44, 40), (206, 178, 128), (42, 50, 84)),
    "rug_bedroom": ((86, 104, 116), (214, 206, 188), (150, 96, 70)),
    "runner": ((66, 88, 72), (198, 176, 126), (128, 50, 44)),
}


def _recipes() -> dict[str, _Recipe]:
    out = {name: _Recipe(partial(textures.plaster, base=base), 2.0) for name, base in WALLS.items()}
    out |= {name: _Recipe(partial(textures.wood, base=base), 0.8) for name, base in WOODS.items()}
    out |= {name: _Recipe(partial(textures.planks, base=base), 1.7) for name, base in BOARDS.items()}
    out |= {name: _Recipe(partial(textures.fabric, base=base), 0.5) for name, base in CLOTHS.items()}
    out |= {name: _Recipe(partial(textures.patterned, base=a, other=b), 0.9) for name, (a, b) in PRINTS.items()}
    out |= {name: _Recipe(partial(textures.rug, colors=colors)) for name, colors in RUGS.items()}
    out |= {f"painting_{k}": _Recipe(pictures.landscape if k % 2 else pictures.abstract) for k in range(PAINTINGS)}
    out |= {f"poster_{k}": _Recipe(pictures.poster) for k in range(POSTERS)}
    out |= {f"spines_{k}": _Recipe(pictures.spines) for k in range(SPINES)}
    stripes = partial(textures.wallpaper, base=(204, 196, 206), other=(190, 180, 196))
    floor = partial(textures.tiles, base=(196, 188, 176), grout=(128, 122, 114))
    splash = partial(textures.tiles, base=(212, 222, 220), grout=(160, 160, 156), count=8, spread=0.08)
    return out | {
        "white_wood": _Recipe(partial(textures.wood, base=(228, 224, 214), contrast=0.35), 0.8),
        "wall_bedroom": _Recipe(stripes, 1.6),
        "brick": _Recipe(partial(textures.brick, base=(164, 92, 70), mortar=(186, 178, 166)), 0.96),
        "floor_tiles": _Recipe(floor, 2.0),
        "splash": _Recipe(splash, 0.9),
        "worktop": _Recipe(partial(textures.stone, base=(96, 92, 90)), 0.8),
        "ceramic": _Recipe(partial(textures.plaster, base=(214, 210, 204)), 0.5),
        "enamel": _Recipe(partial(textures.plaster, base=(226, 228, 228), strength=0.5)),
        "dark": _Recipe(partial(textures.plaster, base=(38, 38, 42)), 0.5),
        "metal": _Recipe(partial(textures.wood, base=(150, 152, 156), contrast=0.3), 0.4),
        "skin": _Recipe(partial(textures.plaster, base=(206, 160, 132), strength=2.0), 0.5),
        "leaves": _Recipe(textures.leaves, 0.5),
        "door": _Recipe(partial(textures.door, base=(222, 214, 198))),
        "carton": _Recipe(partial(pictures.carton, base=(178, 138, 94))),
        "screen_on": _Recipe(partial(pictures.screen, lit=True), glow=0.8),
        "screen_off": _Recipe(partial(pictures.screen, lit=False)),
        "view": _Recipe(pictures.view, glow=1.5, lamp="day"),
        "shade": _Recipe(partial(textures.fabric, base=(244, 226, 190), contrast=0.4), 0.3, glow=1.7),
    }


def stream(seed: int, name: str) -> np.random.Generator:
    """A random stream of its own for each named thing, so that one more thing does not change the others."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def make_materials(seed: int, names: Iterable[str]) -> dict[str, Material]:
    """Paint the named materials; each is the same for a seed whatever else is painted."""
    recipes = _recipes()
    chosen = {name: recipes[name] for name in sorted(set(names))}
    return {name: Material(r.paint(stream(seed, name)), r.tile, r.glow, r.lamp) for name, r in chosen.items()}
