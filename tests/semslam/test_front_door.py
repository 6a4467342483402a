"""What a user's script sees of the package: types, names, ``python -m semslam``."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import semslam

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """\
from semslam import Config, LoopCloser, Slam, load_config, open_dataset, run

result = run(open_dataset("synthetic:room"), load_config(overrides={"detector": "none"}))
closer = LoopCloser(open_dataset("synthetic:room").intrinsics, "thumbnail", Config())
reveal_type(run)
reveal_type(Slam)
reveal_type(LoopCloser)
reveal_type(open_dataset)
reveal_type(load_config)
reveal_type(result.metrics.optimized.ate_rmse_m)
"""


def check_types(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run mypy on a user's script; it reads our sources but reports on the script alone."""
    (folder / "script.py").write_text(script)
    options = [
        "--strict",
        "--follow-imports=silent",
        "--ignore-missing-imports",
        "--cache-dir",
        ROOT / ".mypy_cache/user",
    ]
    return subprocess.run(
        [sys.executable, "-m", "mypy", *options, "script.py"],
        cwd=folder,
        env=os.environ | {"MYPYPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_facade_is_typed(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    done = check_types(SCRIPT, tmp_path)
    assert done.returncode == 0, done.stdout
    revealed = re.findall(r'Revealed type is "(.*)"', done.stdout)
    homes = ("RunResult", "slam.Slam", "closer.LoopCloser", "dataset.Dataset", "settings.Config", "float | None")
    assert len(revealed) == len(homes)
    for found, home in zip(revealed, homes, strict=True):
        assert found.endswith(home)


def test_a_misspelt_name_is_a_type_error(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    done = check_types("from semslam import open_datasett\n", tmp_path)
    assert done.returncode == 1
    assert 'has no attribute "open_datasett"' in done.stdout


def test_the_package_says_that_it_is_typed() -> None:
    assert (ROOT / "semslam" / "py.typed").is_file()


def test_every_public_name_is_found() -> None:
    assert dir(semslam) == semslam.__all__
    for name in semslam.__all__:
        assert getattr(semslam, name) is not None
    with pytest.raises(AttributeError, match="nonsense"):
        _ = semslam.nonsense


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "semslam", "--version"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stdout == f"semslam {semslam.__version__}\n", done.stderr
