"""Links between map keyframes: chains of registered images add up and hold an adjustment as far as they are certain."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from semslam.frontend.direct.search import Registered
from semslam.frontend.feature_map.links import ImageChain, Link, add_links, link_cost, link_errors
from semslam.geometry.reprojection import retract
from semslam.geometry.se3 import invert

SEEDS = st.integers(0, 10_000)


def some_pose(rng, size=0.3):
    return retract(np.eye(4), rng.normal(0, size, 6))


def information_of(rng):
    A = rng.normal(0, 1, (6, 6))
    return A @ A.T + 6 * np.eye(6)


@given(SEEDS)
def test_a_chain_is_the_product_of_its_motions_with_the_sum_of_their_errors(seed):
    rng = np.random.default_rng(seed)
    motions = [some_pose(rng) for _ in range(4)]
    sigma, chain = 1e-4, ImageChain()
    chain.begin()
    for T in motions:
        chain.extend(Registered(T, np.eye(6) / sigma**2))
    link = chain.link(0, 1)
    np.testing.assert_allclose(link.T_earlier_later, np.linalg.multi_dot(motions), atol=1e-12)
    drawn = []
    for _ in range(400):
        noisy = [retract(T, rng.normal(0, sigma, 6)) for T in motions]
        drawn.append(link_errors([link], np.stack([np.eye(4), np.linalg.multi_dot(noisy)]))[0])
    expected = np.sqrt(np.diag(np.linalg.inv(link.information)))
    np.testing.assert_allclose(np.std(drawn, axis=0), expected, rtol=0.25)


def test_an_image_that_does_not_match_breaks_the_chain_until_the_next_keyframe():
    step, chain = Registered(np.eye(4), np.eye(6)), ImageChain()
    assert chain.link(0, 1) is None
    chain.begin()
    chain.extend(step)
    assert chain.link(0, 1) is not None
    chain.extend(None)
    chain.extend(step)
    assert chain.link(0, 1) is None
    chain.begin()
    chain.extend(step)
    assert chain.link(1, 2) is not None


@given(SEEDS, st.integers(1, 3))
def test_links_alone_lead_the_free_poses_to_where_they_say(seed, free):
    rng = np.random.default_rng(seed)
    truth = [some_pose(rng, 0.5) for _ in range(4)]
    links = [
        Link(i, j, invert(truth[i]) @ truth[j], information_of(rng))
        for i, j in ((3, 2), (0, 3), (1, 0), (2, 1))
    ]  # fmt: skip
    poses = np.stack([retract(T, rng.normal(0, 0.02, 6)) if k < free else T for k, T in enumerate(truth)])
    for _ in range(8):
        H, g = np.zeros((6 * free, 6 * free)), np.zeros(6 * free)
        add_links(links, poses, free, 2.0, H, g)
        tangents = np.linalg.solve(H, g)
        poses[:free] = [retract(T, tangents[6 * k : 6 * k + 6]) for k, T in enumerate(poses[:free])]
    np.testing.assert_allclose(poses, np.stack(truth), atol=1e-6)
    assert link_cost(links, np.stack(truth)) < 1e-12
