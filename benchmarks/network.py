"""After a change of the segmentation network: learn what depends on it, and measure what was published of it.

    python benchmarks/network.py NYUV2 FOLDER SEQUENCE... [--before WEIGHTS.onnx] [--steps score,steady,pairs]

Steps: learn (writes loop/weights), score, steady, precision, pairs, runs. Each is one command of this project whose
output goes to FOLDER/STEP.txt. With ``--before``, all but ``learn`` are done a second time with those weights, to
FOLDER/STEP.before.txt.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

BENCHMARKS = Path(__file__).parent
LABELLED = "semantic,semantic-paper,fused,static-cnn,tnnlost,topology,subgraph"
"""The detectors whose answers depend on labels."""
STEPS = ("learn", "score", "steady", "precision", "pairs", "runs")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photos", type=Path, help="folder in the NYUv2 layout")
    parser.add_argument("folder", type=Path, help="where the outputs go")
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("--before", type=Path, help="weights to compare with")
    parser.add_argument("--steps", default=",".join(STEPS))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    for step in args.steps.split(","):
        for suffix, weights in (("", None), (".before", args.before)):
            if suffix and (weights is None or step == "learn"):
                continue
            settings = [] if weights is None else ["--set", f"segmentation.weights={weights}"]
            output = args.folder / f"{step}{suffix}.txt"
            with output.open("w", encoding="utf-8") as file:
                for command in commands(step, args.photos, args.folder, args.sequences, suffix):
                    subprocess.run([sys.executable, *command, *settings], stdout=file, check=True)
            print(output, flush=True)


def commands(step: str, photos: Path, folder: Path, sequences: Sequence[str], suffix: str) -> list[list[str]]:
    """The commands of a step, without the interpreter."""
    ours, out = ["-m", "semslam"], str(folder / f"{step}{suffix}")
    if step == "learn":
        return [[str(BENCHMARKS / "train_detectors.py"), str(photos), "--parts", "words,fusion,static,places,tnnlost"]]
    if step == "score":
        score = [*ours, "eval-segmenter", str(photos), "--json"]
        return [score, [*score, "--no-depth"]]
    if step == "steady":
        return [[str(BENCHMARKS / "segmentation.py"), "steady", "--sequence", sequence] for sequence in sequences]
    if step == "precision":
        return [
            [*ours, "loops", sequence, "--detectors", LABELLED, "--out", f"{out}/{number}"]
            for number, sequence in enumerate(sequences)
        ]
    if step == "pairs":
        return [[*ours, "pairs", *sequences, "--detectors", LABELLED, "--out", out]]
    return [
        [*ours, "compare", sequence, "--detectors", f"none,{LABELLED}", "--no-plots", "--out", f"{out}/{number}"]
        for number, sequence in enumerate(sequences)
    ]


if __name__ == "__main__":
    main()
