"""SE(3) identities that must hold for any transform."""

import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semslam.errors import TrajectoryError
from semslam.geometry.se3 import (
    FloatArray,
    adjoint,
    compose,
    exp_so3,
    interpolate,
    invert,
    is_rigid,
    log_so3,
    make_transform,
    orthonormalise,
    quaternions_to_rotations,
    rotation_angle,
    rotations_to_quaternions,
    tangent,
    tangents,
    transform_points,
)

angles = st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3)
shifts = st.lists(st.floats(-10, 10), min_size=3, max_size=3)
transforms = st.builds(lambda r, t: make_transform(exp_so3(r), t), angles, shifts)


@given(transforms)
def test_inverse_undoes_a_transform(T: FloatArray) -> None:
    np.testing.assert_allclose(T @ invert(T), np.eye(4), atol=1e-12)


@given(transforms, shifts)
def test_points_move_as_homogeneous_coordinates_do(T: FloatArray, point: list[float]) -> None:
    np.testing.assert_allclose(transform_points(T, np.array([point]))[0], (T @ [*point, 1.0])[:3], atol=1e-12)


@given(angles)
def test_rotation_vector_survives_exp_and_log(vector: list[float]) -> None:
    np.testing.assert_allclose(log_so3(exp_so3(vector)), vector, atol=1e-7)
    assert float(rotation_angle(make_transform(exp_so3(vector), np.zeros(3)))) == pytest.approx(
        np.linalg.norm(vector), abs=1e-9
    )


@given(st.lists(transforms, min_size=1, max_size=5))
def test_many_tangents_are_those_of_each(many: list[FloatArray]) -> None:
    small = [make_transform(exp_so3(0.1 * log_so3(T[:3, :3])), T[:3, 3]) for T in many]
    np.testing.assert_allclose(tangents(np.stack(small)), [tangent(T) for T in small], atol=1e-9)


@given(st.lists(transforms, min_size=1, max_size=5))
def test_quaternions_survive_both_ways(many: list[FloatArray]) -> None:
    rotations = np.stack(many)[:, :3, :3]
    quaternions = rotations_to_quaternions(rotations)
    assert (quaternions[:, 3] >= 0).all()
    np.testing.assert_allclose(quaternions_to_rotations(quaternions), rotations, atol=1e-12)


def test_half_turns_keep_their_axis() -> None:
    for axis in np.eye(3):
        R = exp_so3(np.pi * axis)
        np.testing.assert_allclose(quaternions_to_rotations(rotations_to_quaternions(R))[0], R, atol=1e-12)


@given(transforms)
def test_adjoint_is_that_of_gtsam(T: FloatArray) -> None:
    np.testing.assert_allclose(adjoint(T), gtsam.Pose3(T).AdjointMap(), atol=1e-9)


@given(transforms, transforms)
def test_interpolation_meets_both_ends(T_w_a: FloatArray, T_w_b: FloatArray) -> None:
    np.testing.assert_allclose(interpolate(T_w_a, T_w_b, 0.0), T_w_a, atol=1e-9)
    if float(rotation_angle(invert(T_w_a) @ T_w_b)) < 3.0:
        np.testing.assert_allclose(interpolate(T_w_a, T_w_b, 1.0), T_w_b, atol=1e-6)


@given(transforms, st.floats(1e-6, 1e-2))
def test_orthonormalising_mends_a_drifted_rotation(T: FloatArray, noise: float) -> None:
    bent = T.copy()
    bent[:3, :3] += noise * np.arange(9).reshape(3, 3) / 9
    assert is_rigid(orthonormalise(bent), tolerance=1e-12)


def test_a_long_chain_stays_rigid() -> None:
    step = make_transform(exp_so3([0.1, 0.02, -0.03]), [0.1, 0.0, 0.01])
    poses = compose([step] * 1000, np.eye(4))
    assert poses.shape == (1001, 4, 4)
    assert is_rigid(poses, tolerance=1e-12)


@pytest.mark.parametrize("bad", [np.full((4, 4), np.nan), 2 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0]), np.eye(3)])
def test_what_is_no_transform_is_told_apart(bad: FloatArray) -> None:
    assert not is_rigid(bad)


def test_a_zero_quaternion_is_refused() -> None:
    with pytest.raises(TrajectoryError, match="quaternion"):
        quaternions_to_rotations([[0.0, 0.0, 0.0, 0.0]])
