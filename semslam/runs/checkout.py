"""The commit that this package runs from, where it runs from a checkout."""

import subprocess
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 10.0


@cache
def commit() -> str | None:
    """The checkout's commit, with "-dirty" where files differ from it; None of an installed package."""
    if not (ROOT / ".git").exists():
        return None
    command = ("git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=40")
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    except (OSError, subprocess.SubprocessError):  # no git, or not its owner's checkout
        return None
    return answer.stdout.strip() or None
