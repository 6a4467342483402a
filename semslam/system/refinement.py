"""The last step of a run: bundle adjustment of keyframes and the landmarks that they share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from semslam.backend.bundle.bundle import adjust
from semslam.backend.bundle.held_out import HeldOut
from semslam.backend.bundle.tracks import MatchedFeatures, join_tracks
from semslam.backend.pose_graph import GraphSolution
from semslam.config import Config
from semslam.errors import GraphError
from semslam.loop.verification.neighbours import shared_features
from semslam.types import Intrinsics, Keyframe, Observations

STAY = "The poses are those of the pose graph."
SEEN_TWICE = {"min_views": 2}
"""Features that closures share are no part of odometry, so that two views of one already add information."""


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """What became of a solution.

    Attributes:
        solution: the one to go on with.
        held_out: what observations that took no part say of the adjustment; None where there was none, or are too few.
        notes: what was not done, a sentence each.
    """

    solution: GraphSolution
    held_out: HeldOut | None = None
    notes: tuple[str, ...] = ()


def refine(
    solution: GraphSolution, keyframes: Sequence[Keyframe], observations: Mapping[int, Observations], config: Config
) -> Refinement:
    """The solution with its poses after bundle adjustment, where these predict observations held out better.

    The landmarks are those that the odometry keeps. One that keeps none, such as ICP, gets them from its closures:
    the features on which the accepted loops rest, and those that a keyframe shares with the one before it. Without
    an accepted loop the poses stay as they are: odometry has adjusted its own map already.

    Args:
        solution: the optimised graph.
        keyframes: ``keyframes[i].id`` is i.
        observations: landmarks that the odometry saw, by keyframe; may be empty.
        config: its sections ``backend`` and ``verification``, and the seed.
    """
    settings = config.backend.bundle
    if not (settings.rounds and solution.loops):
        return Refinement(solution)
    if not observations:
        if not settings.closures:
            return Refinement(solution)
        observations = _shared(solution, keyframes, config)
        settings = settings.model_copy(update=SEEN_TWICE)
    edges = (*solution.odometry, *solution.loops, *solution.covisible)
    camera = keyframes[0].intrinsics
    observations = {key: _as_seen_by(camera, keyframes[key].intrinsics, seen) for key, seen in observations.items()}
    try:
        result = adjust(solution.poses, observations, camera, settings, edges)
    except GraphError as error:
        return Refinement(solution, notes=(f"{error} {STAY}",))
    held_out = result.held_out
    if held_out is not None and held_out.is_worse:
        note = (
            f"The last adjustment was undone: the error of {held_out.observations} observations held out rose from "
            f"{held_out.before:.3f} to {held_out.after:.3f} px. {STAY}"
        )
        return Refinement(solution, held_out, (note,))
    return Refinement(replace(solution, poses=result.poses), held_out)


def _as_seen_by(camera: Intrinsics, own: Intrinsics, seen: Observations) -> Observations:
    """Observations in the pixels of another camera at the same place; merged sessions may have different ones."""
    if (own.fx, own.fy, own.cx, own.cy) == (camera.fx, camera.fy, camera.cx, camera.cy):
        return seen
    scale = np.array([camera.fx / own.fx, camera.fy / own.fy])
    pixels = (seen.pixels - (own.cx, own.cy)) * scale + (camera.cx, camera.cy)
    sigmas = np.ones_like(seen.depths) if seen.sigmas is None else seen.sigmas
    return replace(seen, pixels=pixels.astype(np.float32), sigmas=(sigmas * scale[0]).astype(np.float32))


def _shared(solution: GraphSolution, keyframes: Sequence[Keyframe], config: Config) -> dict[int, Observations]:
    pairs = []
    for verdict in solution.verdicts:
        loop = verdict.constraint
        if verdict.accepted and loop.shared is not None:
            pairs.append(MatchedFeatures(loop.query, loop.match, loop.shared))
    for before, after in pairwise(keyframes):
        if before.map_id == after.map_id:
            rows = shared_features(after, before, config.verification, config.seed)
            if rows is not None:
                pairs.append(MatchedFeatures(after.id, before.id, rows))
    return join_tracks({keyframe.id: keyframe.finest for keyframe in keyframes}, pairs)
