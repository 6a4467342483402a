"""A walking person: limbs that turn about their joints, each a textured surface."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from semslam.datasets.synthetic import labels
from semslam.datasets.synthetic.shapes import Part, soft_box, turned
from semslam.geometry.se3 import FloatArray, Points3, Transform, exp_so3, make_transform, transform_points

STRIDE = 1.4
"""Metres of two steps."""
HIP, KNEE, SHOULDER, ELBOW = 0.93, -0.45, 1.42, -0.30
"""Metres: hip and shoulder above the floor, knee and elbow below the joint they hang from."""
SWING, KNEE_BEND, ARM_SWING, ELBOW_BEND = 0.45, 0.45, 0.4, 0.35
"""Radians."""
CLOTHES = (("cushion_a", "cloth_blue"), ("quilt", "cloth_black"), ("curtain_living", "cloth_beige"))
"""Shirt and trousers of each person."""
SKIN, HAIR, SHOE = "skin", "walnut", "dark"


@dataclass(frozen=True, slots=True, eq=False)
class Limb:
    """A surface that moves as one.

    Attributes:
        joint: name of the joint it turns about.
        part: its shape in the joint's frame: z up, front towards +y.
    """

    joint: str
    part: Part


class Figure:
    """A person of 1.75 m who stands at the origin and looks along +y.

    Args:
        number: which of the persons; decides on the clothes.
    """

    def __init__(self, number: int) -> None:
        shirt, trousers = CLOTHES[number % len(CLOTHES)]
        limbs = [
            Limb("body", _soft((0, 0, 1.19), (0.40, 0.24, 0.56), shirt, 0.09)),
            Limb("body", _soft((0, 0, 0.90), (0.36, 0.23, 0.20), trousers, 0.08)),
            Limb("body", _rounded(0.0, 0.055, 1.44, 1.56, SKIN)),
            Limb("body", _ball(0.095, 0.125, 1.62, SKIN)),
            Limb("body", _ball(0.105, 0.09, 1.69, HAIR)),
        ]
        for side, x in (("left", -1), ("right", 1)):
            limbs += [
                Limb(f"{side} shoulder", _rounded(x * 0.25, 0.055, ELBOW - 0.03, 0.02, shirt)),
                Limb(f"{side} elbow", _rounded(x * 0.25, 0.042, -0.26, 0.02, SKIN)),
                Limb(f"{side} elbow", _soft((x * 0.25, 0, -0.32), (0.05, 0.09, 0.14), SKIN, 0.02)),
                Limb(f"{side} hip", _rounded(x * 0.1, 0.085, KNEE - 0.04, 0.04, trousers)),
                Limb(f"{side} knee", _rounded(x * 0.1, 0.062, -0.42, 0.03, trousers)),
                Limb(f"{side} knee", _soft((x * 0.1, 0.06, -0.44), (0.10, 0.27, 0.08), SHOE, 0.03)),
            ]
        self._limbs: Sequence[Limb] = limbs

    @cached_property
    def parts(self) -> list[Part]:
        """All surfaces of the standing person, in the order of ``posed``."""
        joints = _joints(0.0, 0.0)
        return [_placed(limb.part, joints[limb.joint]) for limb in self._limbs]

    def posed(self, x: float, y: float, yaw: float, walked: float) -> Points3:
        """Vertices (V, 3) of all parts in turn, of a person in mid-stride.

        Args:
            x: metres.
            y: metres.
            yaw: radians in which the person walks, counter-clockwise from +x.
            walked: metres walked so far, which decide on where in the stride the person is.
        """
        joints = _joints(2 * np.pi * walked / STRIDE, 1.0)
        T_world_figure = make_transform(exp_so3((0.0, 0.0, yaw - np.pi / 2)), np.array([x, y, 0.0]))
        return np.concatenate(
            [transform_points(T_world_figure @ joints[limb.joint], limb.part.vertices) for limb in self._limbs]
        )


def _joints(phase: float, stride: float) -> Mapping[str, Transform]:
    """Frames of all joints in the figure's, in a stride's phase in radians; ``stride`` 0 is standing."""
    joints: dict[str, Transform] = {"body": np.eye(4)}
    for side, turn in (("left", 0.0), ("right", np.pi)):
        swing = stride * np.sin(phase + turn)
        lifted = stride * max(0.0, float(np.cos(phase + turn)))
        joints[f"{side} hip"] = _bent(HIP, SWING * swing)
        joints[f"{side} knee"] = joints[f"{side} hip"] @ _bent(KNEE, -KNEE_BEND * (0.2 * stride + lifted))
        joints[f"{side} shoulder"] = _bent(SHOULDER, -ARM_SWING * swing)
        joints[f"{side} elbow"] = joints[f"{side} shoulder"] @ _bent(ELBOW, ELBOW_BEND * stride)
    return joints


def _bent(height: float, angle: float) -> Transform:
    """A joint at a height whose limb is turned forwards by an angle."""
    return make_transform(exp_so3((angle, 0.0, 0.0)), np.array([0.0, 0.0, height]))


def _placed(part: Part, T: Transform) -> Part:
    vertices, normals = transform_points(T, part.vertices), part.normals @ T[:3, :3].T
    return Part(vertices, normals, part.uvs, part.triangles, part.material, part.label)


def _soft(centre: Sequence[float], size: Sequence[float], material: str, radius: float) -> Part:
    return soft_box(centre, size, material, labels.PERSON, radius)


def _rounded(x: float, radius: float, low: float, high: float, material: str) -> Part:
    """An upright limb with rounded ends."""
    ends = 0.6 * radius
    profile = [(0.0, low), (radius, low + ends), (radius, high - ends), (0.0, high)]
    return turned(profile, (x, 0.0, 0.0), material, labels.PERSON, 12)


def _ball(radius: float, half_height: float, z: float, material: str) -> Part:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 9)
    profile: list[FloatArray] = [np.array([radius * np.cos(a), half_height * np.sin(a)]) for a in angles]
    return turned(profile, (0.0, 0.0, z), material, labels.PERSON, 16)
