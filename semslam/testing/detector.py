"""What every loop detector promises."""

import gc
import weakref
from typing import ClassVar, cast

import numpy as np
import pytest

from semslam.config import Config
from semslam.loop.detector import LoopDetector, Remembering
from semslam.testing.scenes import blank, place
from semslam.testing.settings import check_settings
from semslam.types import Float32Array, UInt8Array

PLACES = 6


class DetectorContract:
    """Inherit from it and name the class under test.

    Attributes:
        implementation: the detector.
        config: settings to build it from; the default asks for every candidate whatever its score.
        proposes: whether it proposes loops at all.
    """

    implementation: ClassVar[type[LoopDetector]]
    config: ClassVar[Config] = Config().with_changes(loops={"min_score": 0.0})
    proposes: ClassVar[bool] = True

    def make(self, config: Config | None = None) -> LoopDetector:
        """A fresh detector."""
        return self.implementation.from_config(config or self.config)

    def filled(self, config: Config | None = None) -> LoopDetector:
        """A detector to which six places were added."""
        detector = self.make(config)
        for number in range(PLACES):
            detector.add(place(number, number))
        return detector

    def test_it_fills_the_role(self) -> None:
        """It has every member, and finds nothing among no keyframes."""
        detector = self.make()
        assert isinstance(detector, LoopDetector)
        assert detector.name
        assert isinstance(detector.needs_labels, bool)
        check_settings(self.implementation)
        assert detector.query(place(0, 0)) == []

    def test_candidates_are_ranked_scored_and_named(self) -> None:
        """Best first, scores within 0..1, each keyframe once by its view and once by its submap."""
        found = self.filled().query(place(50, 2))
        scores = [candidate.score for candidate in found]
        assert scores == sorted(scores, reverse=True)
        assert all(0 <= score <= 1 for score in scores)
        assert all(candidate.detector == self.implementation.name and candidate.query == 50 for candidate in found)
        assert len({(candidate.match, candidate.guess is None) for candidate in found}) == len(found)
        assert {candidate.match for candidate in found} <= set(range(PLACES))

    def test_the_same_view_is_found_again(self) -> None:
        """The best candidate of a view seen before is that view."""
        if not self.proposes:
            pytest.skip("it proposes no loops")
        assert self.filled().query(place(50, 2))[0].match == 2

    def test_a_query_has_no_side_effect_and_repeats(self) -> None:
        """The same question has the same answer, from the same detector and from a new one."""
        detector = self.filled()
        first = detector.query(place(50, 2))
        detector.query(place(51, 3))
        assert detector.query(place(50, 2)) == first
        assert self.filled().query(place(50, 2)) == first

    def test_the_gap_in_time_is_kept(self) -> None:
        """Candidates are at least ``loops.min_gap`` seconds older."""
        detector = self.filled()
        for timestamp in (20.0, 24.9, 25.0, 100.0):
            found = detector.query(place(50, 2, timestamp))
            assert all(timestamp - 10.0 * candidate.match >= self.config.loops.min_gap for candidate in found)

    def test_max_candidates_is_kept(self) -> None:
        """``loops.max_candidates`` limits how many views and how many submaps one query returns."""
        for number in (1, 2):
            config = self.config.with_changes(loops={"max_candidates": number})
            found = self.filled(config).query(place(50, 2))
            assert sum(candidate.guess is None for candidate in found) <= number
            assert sum(candidate.guess is not None for candidate in found) <= number

    def remembering(self) -> Remembering:
        """A filled detector that can forget; the test is skipped where it states that it cannot."""
        detector = self.filled()
        if not isinstance(detector, Remembering):
            pytest.skip("it cannot forget keyframes")
        return detector

    def test_what_is_forgotten_was_never_added(self) -> None:
        """The others are found as by a detector to which only they were added; unknown keyframes are passed over."""
        forgetful = self.remembering()
        forgetful.forget([2, 4, 1000])
        other = self.make()
        for number in range(PLACES):
            if number not in (2, 4):
                other.add(place(number, number))
        for number in range(PLACES):
            found = cast(LoopDetector, forgetful).query(place(50, number))
            assert found == other.query(place(50, number))
            assert not {2, 4} & {candidate.match for candidate in found}

    def test_a_detector_goes_on_after_it_has_forgotten_everything(self) -> None:
        """It finds nothing, and what is added then."""
        forgetful = self.remembering()
        forgetful.forget(range(PLACES))
        detector = cast(LoopDetector, forgetful)
        assert detector.query(place(50, 2)) == []
        assert forgetful.looks() == ()
        detector.add(place(60, 2))
        assert not self.proposes or detector.query(place(70, 2))[0].match == 60

    def test_its_memory_can_be_handed_to_another(self) -> None:
        """A detector that recalls the looks of another one finds the same, keeps the same, and goes on."""
        first = self.remembering()
        looks = first.looks()
        second = self.make()
        cast(Remembering, second).recall(looks)
        assert second.query(place(50, 2)) == cast(LoopDetector, first).query(place(50, 2))
        again = cast(Remembering, second).looks()
        assert [(look.id, look.timestamp) for look in again] == [(look.id, look.timestamp) for look in looks]
        for one, other in zip(looks, again, strict=True):
            assert set(one.arrays) == set(other.arrays)
            assert all(np.array_equal(one.arrays[name], other.arrays[name]) for name in one.arrays)
            assert all(array.ndim >= 1 and array.dtype.kind in "biuf" for array in one.arrays.values())

    def test_images_are_not_kept(self) -> None:
        """Memory must not grow by an image for each keyframe."""
        detector = self.make()
        view = place(0, 0)
        kept: list[weakref.ref[UInt8Array | Float32Array]] = [weakref.ref(view.color), weakref.ref(view.depth)]
        detector.query(view)
        detector.add(view)
        del view
        gc.collect()
        assert [image() for image in kept] == [None, None]

    def test_a_blank_view_is_no_error(self) -> None:
        """A view without texture, depth and classes is answered and added like any other."""
        detector = self.filled()
        dark = blank(60)
        assert all(np.isfinite(candidate.score) for candidate in detector.query(dark))
        detector.add(dark)
        assert isinstance(detector.query(place(70, 2)), list)
