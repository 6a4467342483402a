"""Inject every fault, and write the table of what came of each.

    python -m benchmarks.reliability [--only TEXT] [--page docs/reliability.md] [--check]

It runs about fifty commands in a few minutes. ``--only`` chooses faults by a part of their name, and prints them;
without it the table goes into the page. ``--check`` writes nothing and fails where the page is not what would be
written. Exit code 1: a fault came out otherwise than it should. A fault that cannot be injected here (a full disk needs
a mount) keeps its line of the page.
"""

import argparse
import difflib
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.reliability.bench import Bench, UnavailableError, UnexpectedOutcomeError
from benchmarks.reliability.endings import disks, endings, kills
from benchmarks.reliability.images import damaged, injected, inputs
from benchmarks.reliability.places import network, parts, places
from benchmarks.reliability.table import Fault, inserted, markdown

GROUPS = [c.group for c in (endings, kills, disks, injected, inputs, parts, places, damaged, network)]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "reliability.md"
OWN_MOUNTS = "SEMSLAM_OWN_MOUNTS"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="faults whose name holds this text")
    parser.add_argument("--page", type=Path, default=PAGE, help="page that holds the table")
    parser.add_argument("--check", action="store_true", help="compare with the page instead of writing it")
    arguments = parser.parse_args()
    page, failures = arguments.page.read_text(), 0
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder).resolve())
        bench.prepare()
        for group in GROUPS:
            lines = []
            for fault in group.faults:
                if arguments.only in fault.name:
                    outcome = _outcome(fault, bench, page)
                    failures += outcome is None
                    lines.append((fault.name, outcome or "not as it should be"))
                    print(f"{fault.name}: {lines[-1][1]}", flush=True)
            rows.append((group.title, lines))
    if failures or arguments.only:
        return int(failures > 0)
    written = inserted(page, markdown(rows))
    if not arguments.check:
        arguments.page.write_text(written)
        return 0
    sys.stdout.writelines(difflib.unified_diff(page.splitlines(True), written.splitlines(True), "page", "measured"))
    return int(page != written)


def _outcome(fault: Fault, bench: Bench, page: str) -> str | None:
    """What came of a fault; None where that is not what should."""
    try:
        return fault.inject(bench)
    except UnexpectedOutcomeError as error:
        print(error, file=sys.stderr)
        return None
    except UnavailableError as error:
        print(f"{fault.name}: {error}", file=sys.stderr)
        line = next((line for line in page.splitlines() if line.startswith(f"| {fault.name} |")), "")
        return line.removeprefix(f"| {fault.name} |").removesuffix("|").strip() or str(error)


def _with_own_mounts() -> None:
    """Begin again in a namespace in which disks may be mounted, where there can be one."""
    if OWN_MOUNTS in os.environ:
        return
    os.environ[OWN_MOUNTS] = "1"
    unshare = ["unshare", "--map-root-user", "--mount"] if os.geteuid() else ["unshare", "--mount"]
    try:
        possible = subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        possible = False
    if possible:
        os.execvp(unshare[0], [*unshare, sys.executable, "-m", "benchmarks.reliability", *sys.argv[1:]])


if __name__ == "__main__":
    _with_own_mounts()
    sys.exit(main())
