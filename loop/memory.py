"""What a search knows of its keyframes, and what is left of one that is forgotten."""

from dataclasses import dataclass, fields, replace

from semslam.loop.detector import Look
from semslam.types import Cloud, Features, Keyframe


@dataclass(frozen=True, slots=True, eq=False)
class LoopMemory:
    """What another search needs to go on.

    Attributes:
        keyframes: ascending by id.
        looks: what the detector has kept of them.
        closed: query and match of the verified loops between them.
    """

    keyframes: tuple[Keyframe, ...]
    looks: tuple[Look, ...]
    closed: tuple[tuple[int, int], ...] = ()

    def renumbered(self) -> "LoopMemory":
        """The same with ids that count from 0; a map that is one keyframe's own is numbered as it is."""
        place = {keyframe.id: number for number, keyframe in enumerate(self.keyframes)}
        return LoopMemory(
            tuple(
                replace(k, id=place[k.id], map_id=place[k.id] if k.map_id == k.id else k.map_id) for k in self.keyframes
            ),
            tuple(replace(look, id=place[look.id]) for look in self.looks if look.id in place),
            tuple((place[a], place[b]) for a, b in self.closed if a in place and b in place),
        )


def without_content(keyframe: Keyframe) -> Keyframe:
    """A keyframe without keypoints and points."""
    no_features = Features(*(getattr(keyframe.features, field.name)[:0].copy() for field in fields(Features)))
    return replace(keyframe, features=no_features, cloud=_emptied(keyframe.cloud), details=None)


def without_descriptors(keyframe: Keyframe) -> Keyframe:
    """A keyframe that can be matched no more and adds no points to a map; where its keypoints lie is still known."""
    details = None if keyframe.details is None else _places_alone(keyframe.details)
    return replace(keyframe, features=_places_alone(keyframe.features), cloud=_emptied(keyframe.cloud), details=details)


def _emptied(cloud: Cloud) -> Cloud:
    return Cloud(cloud.points[:0].copy(), cloud.normals[:0].copy())


def _places_alone(features: Features) -> Features:
    return replace(features, descriptors=features.descriptors[:0].copy(), points=features.points[:0].copy())
