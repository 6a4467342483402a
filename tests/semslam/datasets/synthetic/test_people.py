"""Persons in the rendered scenes: labelled, at their depth, and the rest of the image as it is without them."""

import numpy as np
import pytest

from semslam.datasets.synthetic import Request, SyntheticDataset, labels
from semslam.datasets.synthetic.walkers import Walkers, persons
from semslam.errors import DatasetError

CROSSED = 111
"""A frame of the room in whose middle the first person stands."""


def room(**switches: object) -> SyntheticDataset:
    return SyntheticDataset("room", Request.model_validate({"width": 160, "noise": False, **switches}))


def test_a_person_hides_what_is_behind_and_nothing_else() -> None:
    with_person, without = room(people=1).view(CROSSED), room().view(CROSSED)
    person = with_person.labels == labels.PERSON
    assert 0.25 < person.mean() < 0.6
    assert (with_person.depth[person] < without.depth[person] + 1e-4).all()
    assert np.array_equal(with_person.depth[~person], without.depth[~person])
    assert np.array_equal(with_person.labels[~person], without.labels[~person])
    difference = np.abs(with_person.color - without.color).max(2)
    assert np.mean(difference[~person] > 1) < 0.05  # at the silhouette alone
    assert np.mean(difference[person] > 10) > 0.9


def test_persons_leave_the_view_and_come_back() -> None:
    dataset = room(people=1, width=64)
    share = np.array([np.mean(dataset.labels(index) == labels.PERSON) for index in range(100, 124, 2)])
    assert share.min() == 0
    assert 0.35 < share.max() < 0.6


def test_each_person_walks_alone() -> None:
    one, two = room(people=1).view(CROSSED), room(people=2).view(CROSSED)
    first = one.labels == labels.PERSON
    assert (two.labels[first] == labels.PERSON).all()
    assert (two.depth <= one.depth).all()
    with pytest.raises(DatasetError, match="people"):
        Request.parse("people=9")


def test_depth_shows_a_person_at_depths_instant() -> None:
    dataset = room(people=1, delay=0.1)
    late, prompt = dataset.view(CROSSED), room(people=1).view(CROSSED + 1)
    assert np.allclose(late.depth, prompt.depth, atol=1e-5)


def test_a_person_keeps_their_size_and_stays_on_the_ground() -> None:
    dataset = room(people=1)
    walkers = Walkers(persons(1), dataset._way, dataset._way.seconds)
    for seconds in np.linspace(0.0, 17.0, 40):
        vertices = walkers.vertices(float(seconds))
        assert -0.08 < vertices[:, 2].min() < 0.1
        assert vertices[:, 2].max() == pytest.approx(1.78, abs=0.02)
        assert np.ptp(vertices[:, :2], axis=0).max() < 1.3
