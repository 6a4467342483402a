"""The sequences of the TUM RGB-D benchmark and their usual short names."""

import difflib
import re

from semslam.errors import DatasetError

SEQUENCES: dict[str, tuple[str, ...]] = {
    "freiburg1": ("360", "desk", "desk2", "floor", "plant", "room", "rpy", "teddy", "xyz"),
    "freiburg2": (
        "360_hemisphere", "360_kidnap", "coke", "desk", "desk_with_person", "dishes", "flowerbouquet",
        "flowerbouquet_brownbackground", "large_no_loop", "large_with_loop", "metallic_sphere", "metallic_sphere2",
        "pioneer_360", "pioneer_slam", "pioneer_slam2", "pioneer_slam3", "rpy", "xyz",
    ),
    "freiburg3": (
        "cabinet", "large_cabinet", "long_office_household", "nostructure_notexture_far",
        "nostructure_notexture_near_withloop", "nostructure_texture_far", "nostructure_texture_near_withloop",
        "sitting_halfsphere", "sitting_rpy", "sitting_static", "sitting_xyz", "structure_notexture_far",
        "structure_notexture_near", "structure_texture_far", "structure_texture_near", "teddy",
        "walking_halfsphere", "walking_rpy", "walking_static", "walking_xyz",
    ),
}  # fmt: skip
"""Camera -> sequences (https://cvg.cit.tum.de/data/datasets/rgbd-dataset/download)."""

ALIASES = {
    "freiburg3_long_office": "freiburg3_long_office_household",
    "freiburg3_office": "freiburg3_long_office_household",
    "freiburg3_nst_near": "freiburg3_nostructure_texture_near_withloop",
    "freiburg3_nst_near_loop": "freiburg3_nostructure_texture_near_withloop",
    "freiburg3_nst_far": "freiburg3_nostructure_texture_far",
    "freiburg3_str_tex_near": "freiburg3_structure_texture_near",
    "freiburg3_str_tex_far": "freiburg3_structure_texture_far",
}


def short_names() -> list[str]:
    """All sequences as "fr1/room"."""
    return [f"{camera.replace('freiburg', 'fr')}/{name}" for camera, names in SEQUENCES.items() for name in names]


def folder_name(name: str) -> str:
    """The folder of a sequence, such as ``rgbd_dataset_freiburg1_room``.

    Args:
        name: "fr1/room", "fr1_room", "freiburg1_room" or the folder's own name; case does not matter.

    Raises:
        DatasetError: there is no such sequence; the message suggests the nearest.
    """
    plain = re.sub(r"[/\s-]+", "_", name.strip().strip("/").lower()).removesuffix(".tgz")
    plain = re.sub(r"^fr(?=\d_)", "freiburg", plain.removeprefix("rgbd_dataset_"))
    plain = ALIASES.get(plain, plain)
    camera, _, sequence = plain.partition("_")
    if sequence in SEQUENCES.get(camera, ()):
        return f"rgbd_dataset_{plain}"
    near = difflib.get_close_matches(
        plain.replace("freiburg", "fr").replace("_", "/", 1), short_names(), n=3, cutoff=0.4
    )
    hint = f"; near to it: {', '.join(near)}" if near else ""
    raise DatasetError(f"There is no TUM RGB-D sequence '{name}'{hint}.")
