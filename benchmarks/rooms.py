"""Two rooms that look alike, and odometry that drifts by metres: which loops the graph accepts.

    python benchmarks/rooms.py [--tours 150]

Simulated tours of about 120 keyframes: a room, its twin 4.3 m away, a hall on a detour, the hall again, and then the
room or the twin again, in turns. Seven true loops join the visits of the hall; of the 15 true and the 15 false loops of
the last room a random part is there, and in three tours of ten no true one. Noise in metres and 2 mrad a keyframe,
which the covariance states rightly (1) or as half of it (2). Printed: accepted loops of the last room.
"""

import argparse

import numpy as np

from semslam.backend.analysis.judge import constraint_of, rebuilt
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.config import BackendConfig
from semslam.geometry.se3 import FloatArray, compose

APART = np.array([4.3, 0.0, 0.0])
ROOM = ring(15, laps=1, radius=0.8)
NOISES, FACTORS = (0.1, 0.2, 0.3), (1, 2)
HALL_LOOPS = 7


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tours", type=int, default=150)
    args = parser.parse_args()
    print("| noise, m | stated as 1 / | true accepted | of | false accepted | of | tours with false ones |")
    print("|---|---|---|---|---|---|---|")
    for noise in NOISES:
        for factor in FACTORS:
            counts = np.array([count(tour, noise, factor) for tour in range(args.tours)])
            true, of_true, false, of_false = counts.sum(axis=0)
            wrong = int((counts[:, 2] > 0).sum())
            print(f"| {noise} | {factor} | {true} | {of_true} | {false} | {of_false} | {wrong} |", flush=True)


def count(tour: int, noise: float, factor: int) -> tuple[int, int, int, int]:
    """Accepted true loops of the last room and all of these, and the same of false loops."""
    rng = np.random.default_rng(tour)
    in_twin = bool(tour % 2)
    poses, first = walk(in_twin)
    present = rng.uniform(size=15) >= rng.uniform()
    lookalike = rng.uniform(size=15) >= rng.uniform()
    if rng.uniform() < 0.3:
        present[:] = False
    room, twin, last = first[0], first[2], first[7]
    here, elsewhere = (twin, room) if in_twin else (room, twin)
    hall = [(first[4] + 19 - k, first[5] + k) for k in range(0, 20, 3)]
    true = measure(poses, hall + [(here + k, last + k) for k in range(15) if present[k]], rng)
    alike = poses.copy()
    alike[twin : first[3], :3, 3] -= APART
    if in_twin:
        alike[last:, :3, 3] -= APART
    false = measure(alike, [(elsewhere + k, last + k) for k in range(15) if lookalike[k]], rng)
    odometry = measure_odometry(poses, rng, 1.0, np.r_[[0.002] * 3, [noise] * 3])
    stated = [edge.widened(1.0 / factor) for edge in odometry]
    start = dict(enumerate(compose([edge.T_from_to for edge in odometry], poses[0])))
    graph = rebuilt(start, stated, [constraint_of(loop) for loop in (*true, *false)], (), BackendConfig())
    accepted = [verdict.accepted for verdict in graph.optimize().verdicts]
    return sum(accepted[HALL_LOOPS : len(true)]), int(present.sum()), sum(accepted[len(true) :]), int(lookalike.sum())


def walk(in_twin: bool) -> tuple[FloatArray, list[int]]:
    """Poses (N, 4, 4) of a tour, and the first keyframe of each of its eight parts."""
    twin = ROOM.copy()
    twin[:, :3, 3] += APART
    hall = _still(20)
    t = np.linspace(0.0, np.pi, 20)
    hall[:, :3, 3] += np.stack([1.0 + 3.0 * np.sin(t), 0.0 * t, 6.0 * np.sin(t)], axis=1)
    back = _along(0.1, 0.9, 8) if in_twin else _along(0.0, 0.1, 8)
    parts = [ROOM, _along(0.1, 0.9, 10), twin, _along(0.9, 0.1, 10), hall, hall[::-1], back, twin if in_twin else ROOM]
    return np.concatenate(parts), np.cumsum([0, *map(len, parts[:-1])]).tolist()


def _along(start: float, end: float, count: int) -> FloatArray:
    """Keyframes (count, 4, 4) on the way from the room to its twin."""
    poses = _still(count)
    poses[:, :3, 3] += np.linspace(start, end, count)[:, None] * APART
    return poses


def _still(count: int) -> FloatArray:
    return np.tile(ROOM[0], (count, 1, 1))


if __name__ == "__main__":
    main()
