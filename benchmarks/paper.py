"""The paper's experiments on its own three sequences, where they have been downloaded.

    semslam download fr1/room DATA    (and fr2/large_with_loop, fr3/long_office_household)
    python benchmarks/paper.py DATA --out paper-results

For each sequence of paper.yaml: precision-recall curves (Figure 13) and a run with each detector; then the pair test
over all of them (Table 2), each sequence at the threshold that is best on the others. The results are in the usual
files: loops.json, compare.json, pairs.json.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import yaml

from semslam.datasets.tum_names import folder_name

SUITE = Path(__file__).with_name("paper.yaml")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of the downloaded sequences")
    parser.add_argument("--out", type=Path, default=Path("paper-results"))
    parser.add_argument("--suite", type=Path, default=SUITE)
    args = parser.parse_args()
    suite = yaml.safe_load(args.suite.read_text(encoding="utf-8"))
    names = ",".join(suite["detectors"])
    found = []
    for sequence in suite["sequences"]:
        path = args.data / folder_name(sequence["name"])
        if not path.is_dir():
            print(f"{path} is not there; fetch it with: semslam download {sequence['name']}")
            continue
        found.append(str(path))
        out = args.out / path.name
        semslam("loops", path, "--detectors", names, "--every", sequence["every"], "--out", out / "loops")
        semslam("compare", path, "--detectors", f"none,{names}", "--odometry", suite["odometry"], "--out", out / "runs")
    if found:
        semslam("pairs", *found, "--detectors", names, "--every", 10, "--out", args.out / "pairs")


def semslam(*arguments: object) -> None:
    """Run a command; one that fails has printed why, and the others still run."""
    print("semslam", *arguments, flush=True)
    subprocess.run([str(Path(sys.executable).with_name("semslam")), *map(str, arguments)], check=False)


if __name__ == "__main__":
    main()
