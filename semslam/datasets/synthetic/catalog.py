"""The materials of all scenes, by name."""

import zlib
from collections.abc import Callable

import numpy as np

from semslam.datasets.synthetic import pictures, textures
from semslam.datasets.synthetic.atlas import Material
from semslam.datasets.synthetic.textures import Image

PAINTINGS = 18
POSTERS = 8


def stream(seed: int, name: str) -> np.random.Generator:
    """A random stream of its own for each named thing, so that one more thing does not change the others."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def make_materials(seed: int) -> dict[str, Material]:
    """Paint all textures; deterministic for a seed."""
    out: dict[str, Material] = {}

    def add(
        name: str, paint: Callable[[np.random.Generator], Image], tile: float = 1.0, glow: float = 0.0,
        lamp: str = "lamps",
    ) -> None:  # fmt: skip
        out[name] = Material(paint(stream(seed, name)), (tile, tile), glow, lamp)

    for name, base in {
        "wall_living": (226, 216, 196), "wall_study": (186, 204, 206), "wall_corridor": (232, 226, 212),
        "wall_kitchen": (230, 222, 178), "ceiling": (242, 240, 234),
    }.items():  # fmt: skip
        add(name, lambda rng, base=base: textures.plaster(rng, base), 2.0)
    add("wall_bedroom", lambda rng: textures.wallpaper(rng, (204, 196, 206), (190, 180, 196)), 1.6)
    add("brick", lambda rng: textures.brick(rng, (164, 92, 70), (186, 178, 166)), 0.96)
    for name, wood in {
        "oak": (176, 132, 84), "walnut": (104, 70, 46), "pine": (206, 168, 118), "white_wood": (228, 224, 214),
        "dark_wood": (66, 48, 38), "cherry": (140, 76, 48),
    }.items():  # fmt: skip
        add(name, lambda rng, wood=wood: textures.wood(rng, wood, 0.5 if min(wood) > 200 else 1.0), 0.8)
    add("floor_oak", lambda rng: textures.planks(rng, (172, 128, 84)), 1.7)
    add("floor_dark", lambda rng: textures.planks(rng, (120, 84, 58)), 1.7)
    add("floor_pale", lambda rng: textures.planks(rng, (198, 170, 132)), 1.7)
    add("floor_tiles", lambda rng: textures.tiles(rng, (196, 188, 176), (128, 122, 114)), 2.0)
    add("splash", lambda rng: textures.tiles(rng, (212, 222, 220), (160, 160, 156), 8, 0.08), 0.9)
    add("worktop", lambda rng: textures.stone(rng, (96, 92, 90)), 0.8)
    add("ceramic", lambda rng: textures.plaster(rng, (214, 210, 204)), 0.5)
    add("metal", lambda rng: textures.wood(rng, (150, 152, 156), 0.3), 0.4)
    add("dark", lambda rng: textures.plaster(rng, (38, 38, 42)), 0.5)
    add("enamel", lambda rng: textures.plaster(rng, (226, 228, 228), 0.5), 1.0)
    for name, cloth in {
        "cloth_blue": (62, 84, 124), "cloth_grey": (128, 126, 124), "cloth_red": (150, 52, 46),
        "cloth_green": (84, 108, 82), "cloth_beige": (196, 178, 150), "cloth_black": (52, 52, 56),
        "linen": (226, 222, 214),
    }.items():  # fmt: skip
        add(name, lambda rng, cloth=cloth: textures.fabric(rng, cloth), 0.5)
    for name, (base, other) in {
        "quilt": ((112, 132, 160), (214, 206, 186)), "cushion_a": ((206, 152, 62), (240, 226, 190)),
        "cushion_b": ((222, 214, 196), (122, 64, 60)), "curtain_living": ((178, 96, 70), (214, 160, 120)),
        "curtain_bedroom": ((120, 134, 160), (186, 190, 200)),
    }.items():  # fmt: skip
        add(name, lambda rng, base=base, other=other: textures.patterned(rng, base, other), 0.9)
    add("rug_living", lambda rng: textures.rug(rng, ((150, 44, 40), (206, 178, 128), (42, 50, 84))))
    add("rug_bedroom", lambda rng: textures.rug(rng, ((86, 104, 116), (214, 206, 188), (150, 96, 70))))
    add("runner", lambda rng: textures.rug(rng, ((66, 88, 72), (198, 176, 126), (128, 50, 44))))
    add("leaves", textures.leaves, 0.5)
    add("door", lambda rng: textures.door(rng, (222, 214, 198)))
    for k in range(PAINTINGS):
        add(f"painting_{k}", pictures.landscape if k % 2 else pictures.abstract)
    for k in range(POSTERS):
        add(f"poster_{k}", pictures.poster)
    for k in range(3):
        add(f"spines_{k}", pictures.spines)
    add("screen_on", lambda rng: pictures.screen(rng, lit=True), glow=0.8)
    add("screen_off", lambda rng: pictures.screen(rng, lit=False))
    add("carton", lambda rng: pictures.carton(rng, (178, 138, 94)))
    add("view", pictures.view, glow=1.5, lamp="day")
    add("shade", lambda rng: textures.fabric(rng, (244, 226, 190), 0.4), 0.3, glow=1.7)
    return out
