"""Kill runs at random moments of tracking and of writing, and go on with each to the bytes of an undisturbed run.

    python -m benchmarks.reliability.kills [--count 20] [--seed 0]

Moments are drawn by the seed: of three kills two come when the journal has so many bytes, one when so many bytes of
results are written; up to 5 ms later, so that they meet no boundary. A third of the resumed runs are killed as well.
Exit code 1: a run did not come out as it should.
"""

import argparse
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.reliability.bench import (
    Bench,
    UnexpectedOutcomeError,
    bytes_in,
    ended,
    journal_of,
    results_of,
    saved,
    wait_for,
)


def sizes_of(bench: Bench) -> tuple[int, int]:
    """Bytes of an undisturbed run's journal, and of what it writes before its name is given."""
    out = bench.new()
    process = bench.start(*bench.words(out))
    journal = 0
    while process.poll() is None:
        journal = max(journal, bytes_in(journal_of(out)))
        time.sleep(0.001)
    ended(process).expect(0)
    return journal, _bytes_below(out)


def kill(bench: Bench, words: tuple[object, ...], watched: Path, size: int, delay: float) -> str:
    """Carry out a command until a file or folder has so many bytes, and kill it; returns what came of that."""
    process = bench.start(*words)
    try:
        wait_for(lambda: _bytes_below(watched) >= size, process)
    except UnexpectedOutcomeError:
        return "finished before"
    time.sleep(delay)
    process.kill()
    return "killed" if ended(process).code == -signal.SIGKILL else "finished before"


def one(bench: Bench, draws: random.Random, number: int, sizes: tuple[int, int]) -> str:
    """Kill a run at a moment, perhaps the resumed one too, and compare what comes of it."""
    out = bench.new()
    in_writing, again = number % 3 == 2, number % 3 == 1
    watched = results_of(out) if in_writing else journal_of(out)
    size = draws.randint(1, sizes[in_writing])
    first = kill(bench, bench.words(out), watched, size, draws.uniform(0, 0.005))
    if again and not out.exists():
        first += ", and again " + kill(bench, ("run", "--resume", out), journal_of(out), 1, draws.uniform(1.0, 4.0))
    if not out.exists():
        bench.semslam("run", "--resume", out).expect(0)
    saved(out)
    bench.check_same(out)
    left = [path.name for path in out.parent.iterdir() if path != out]
    if left:
        raise UnexpectedOutcomeError(f"Something was left behind: {left}")
    return f"{size} bytes of {'results' if in_writing else 'the journal'}: {first}; the same bytes"


def _bytes_below(path: Path) -> int:
    """Size of a file, or of all files below a folder; some may vanish meanwhile."""
    return bytes_in(path) if not path.is_dir() else sum(bytes_in(file) for file in path.rglob("*") if file.is_file())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    draws, failures = random.Random(arguments.seed), 0
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder).resolve())
        bench.prepare()
        sizes = sizes_of(bench)
        for number in range(arguments.count):
            try:
                print(f"{number + 1}: {one(bench, draws, number, sizes)}", flush=True)
            except UnexpectedOutcomeError as error:
                failures += 1
                print(f"{number + 1}: {error}", flush=True)
    print(f"{arguments.count - failures} of {arguments.count} runs ended with the bytes of an undisturbed one.")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
