"""Which topics of a bag are colour, registered depth and the colour camera, by role and namespace."""

import re
from collections.abc import Iterable, Sequence
from enum import StrEnum
from typing import Protocol, TypeVar


class Topic(Protocol):
    """What is known of a topic without reading it: its name and number of messages."""

    @property
    def topic(self) -> str:
        """Its name, such as "/camera/color/image_raw"."""

    @property
    def msgcount(self) -> int:
        """Number of messages."""


TopicT = TypeVar("TopicT", bound=Topic)


class Role(StrEnum):
    """What a camera topic shows."""

    COLOR = "colour"
    DEPTH = "depth"
    OTHER = "other"


_REGISTERED = re.compile(r"registered|aligned|depth_to_(?:colou?r|rgb)")
_COLOR_OF_DEPTH = re.compile(r"(?:colou?r|rgb)_to_depth")
_OTHER = re.compile(r"(?:^|[/_])(?:ir|infra\d*|infrared|fisheye|confidence|disparity|mask|label|thermal)(?:[/_]|\d|$)")
_COLOR = re.compile(r"colou?r|rgb")


def role_of(topic: str) -> Role | None:
    """The role that a topic's name states, or None where it states none (such as "/camera/image_raw")."""
    name = topic.lower()
    if _COLOR_OF_DEPTH.search(name):
        return Role.COLOR
    if "depth" in name:
        return Role.DEPTH
    if _OTHER.search(name):
        return Role.OTHER
    return Role.COLOR if _COLOR.search(name) else None


def is_registered(topic: str) -> bool:
    """Whether a depth topic's name states that it is registered to colour."""
    return _REGISTERED.search(topic.lower()) is not None


def shared_namespace(first: str, second: str) -> int:
    """How many leading parts two topics have in common."""
    count = 0
    for a, b in zip(first.strip("/").split("/"), second.strip("/").split("/"), strict=False):
        if a != b:
            break
        count += 1
    return count


def choose_color(images: Iterable[TopicT]) -> list[TopicT]:
    """Topics that can be colour, the most likely first: named so, then most messages, then the shorter name."""
    fitting = [image for image in images if role_of(image.topic) in (Role.COLOR, None)]
    return sorted(fitting, key=lambda t: (role_of(t.topic) is None, -t.msgcount, len(t.topic), t.topic))


def choose_depth(images: Iterable[TopicT], color: str) -> list[TopicT]:
    """Topics that can be depth, the most likely first: registered to colour, then of the colour image's device."""
    fitting = [image for image in images if role_of(image.topic) is Role.DEPTH]

    def rank(t: TopicT) -> tuple[bool, int, bool, int, int, str]:
        near = shared_namespace(t.topic, color)
        return not is_registered(t.topic), -near, "compressed" in t.topic.lower(), -t.msgcount, len(t.topic), t.topic

    return sorted(fitting, key=rank)


def choose_camera(infos: Sequence[TopicT], color: str) -> TopicT | None:
    """The CameraInfo of the colour images: that with which they share most of their namespace."""
    fitting = [info for info in infos if role_of(info.topic) is not Role.OTHER] or list(infos)
    return min(
        fitting,
        key=lambda t: (-shared_namespace(t.topic, color), role_of(t.topic) is Role.DEPTH, len(t.topic), t.topic),
        default=None,
    )
