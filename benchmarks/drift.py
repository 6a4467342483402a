"""How much drift loops take away: every odometry with and without a detector, over several starts.

    python benchmarks/drift.py SEQUENCE... --odometries feature,dense,kiss --detector semantic --starts 0,2,4,6,8

Prints a Markdown table: the median and the range over the starts of the ATE (SE(3), all frames) in centimetres.
"""

import argparse
import platform
import statistics
from collections.abc import Sequence

from semslam.config import Config, DatasetConfig
from semslam.datasets import open_dataset
from semslam.metrics import Metrics
from semslam.pipeline import run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("--odometries", default="feature_map,feature,dense,kiss")
    parser.add_argument("--detector", default="semantic")
    parser.add_argument("--starts", default="0,2,4,6,8")
    parser.add_argument("--max-frames", type=int)
    args = parser.parse_args()
    starts = [int(start) for start in args.starts.split(",")]
    print(f"{platform.processor() or platform.machine()}, starts {args.starts}\n")
    print(f"| sequence | odometry | alone | none | {args.detector} | accepted | true/inaccurate/false | tracked |")
    print("|---|---|---|---|---|---|---|---|")
    for sequence in args.sequences:
        for odometry in args.odometries.split(","):
            alone = [measure(sequence, odometry, "none", start, args.max_frames) for start in starts]
            closed = [measure(sequence, odometry, args.detector, start, args.max_frames) for start in starts]
            print(row(closed[0].sequence, odometry, alone, closed), flush=True)


def measure(sequence: str, odometry: str, detector: str, start: int, max_frames: int | None) -> Metrics:
    frames = DatasetConfig(start=start, max_frames=max_frames)
    dataset = open_dataset(sequence, frames)
    return run(dataset, Config(odometry=odometry, detector=detector, dataset=frames)).metrics


def row(sequence: str, odometry: str, alone: Sequence[Metrics], closed: Sequence[Metrics]) -> str:
    cells = [
        sequence,
        odometry,
        spread([m.odometry_only.ate_rmse_m for m in alone]),
        spread([m.optimized.ate_rmse_m for m in alone]),
        spread([m.optimized.ate_rmse_m for m in closed]),
        str(statistics.median(m.loops.accepted for m in closed)),
        "/".join(str(sum(getattr(m.loops, kind) or 0 for m in closed)) for kind in ("true", "inaccurate", "false")),
        f"{100 * min(m.tracked / m.frames for m in closed):.0f} %",
    ]
    return f"| {' | '.join(cells)} |"


def spread(metres: Sequence[float | None]) -> str:
    known = [100 * value for value in metres if value is not None]
    if not known:
        return "-"
    return f"{statistics.median(known):.1f} ({min(known):.1f} to {max(known):.1f})"


if __name__ == "__main__":
    main()
