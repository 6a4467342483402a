"""Torch is for training: a run with the defaults, and the check of an installation, do without it."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WITHOUT_TORCH = """\
import sys


class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "torch":
            raise ImportError("torch is blocked")


sys.meta_path.insert(0, Refuse())
from semslam.cli import main

main()
"""


def semslam(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT_TORCH, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_a_run_does_not_import_it(tmp_path: Path) -> None:
    done = semslam("run", "synthetic:room?frames=12", "--out", str(tmp_path / "run"))
    assert done.returncode == 0, done.stderr
    assert '"detector": "fused-objects"' in (tmp_path / "run" / "metrics.json").read_text()


def test_doctor_calls_an_installation_without_it_usable() -> None:
    done = semslam("doctor")
    assert done.returncode == 0, done.stderr
    assert "torch: missing" in done.stdout
    assert "All is well." in done.stdout
