"""Loops that would repeat what loops between neighbouring keyframes have closed already."""

from collections.abc import Collection, Iterable, Sequence

from semslam.types import Keyframe, LoopConstraint

NEIGHBOURHOOD = 2
"""Keyframes by which either end of a loop may lie from another's, in time, where both close the same two places."""


class ClosedPlaces:
    """Counts the verified loops between two places.

    The same camera looks at the same surfaces from nearly the same poses, so loops between two places err alike: each
    further one adds less.
    """

    def __init__(self) -> None:
        self._matches: dict[int, list[int]] = {}

    def note(self, loop: LoopConstraint) -> None:
        """Take in a verified loop."""
        self.recall([(loop.query, loop.match)])

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Query and match of each loop that was noted."""
        return tuple((query, match) for query, matches in self._matches.items() for match in matches)

    def recall(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Take in loops by query and match."""
        for query, match in pairs:
            self._matches.setdefault(query, []).append(match)

    def joins(self, query: int, match: int) -> bool:
        """Whether a verified loop is between these two keyframes."""
        return match in self._matches.get(query, ())

    def touch(self, queries: Collection[int], matches: Collection[int]) -> bool:
        """Whether a verified loop joins neighbours of any keyframes of two submaps.

        Args:
            queries: the newer submap's.
            matches: the older one's.
        """
        near = range(min(queries) - NEIGHBOURHOOD, max(queries) + NEIGHBOURHOOD + 1)
        oldest, newest = min(matches) - NEIGHBOURHOOD, max(matches) + NEIGHBOURHOOD
        return any(oldest <= match <= newest for query in near for match in self._matches.get(query, ()))

    def loops(self, query: int, match: int, keyframes: Sequence[Keyframe]) -> int:
        """How many verified loops join the neighbours of two keyframes; only keyframes of one map are neighbours.

        Args:
            query: the newer keyframe.
            match: the older one.
            keyframes: all so far; ``keyframes[i].id`` is i.
        """
        queries, matches = keyframes[query].map_id, keyframes[match].map_id
        return sum(
            abs(other - match) <= NEIGHBOURHOOD and keyframes[other].map_id == matches
            for near in range(query - NEIGHBOURHOOD, query + NEIGHBOURHOOD + 1)
            for other in self._matches.get(near, ())
            if near < len(keyframes) and keyframes[near].map_id == queries
        )
