"""Rules of the house that no linter checks."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import semslam

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [
    path for folder in ("semslam", "frontend", "loop", "backend", "eval") for path in (ROOT / folder).rglob("*.py")
]


def test_nothing_hides_the_builtin_eval() -> None:
    guilty = [
        str(path)
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Import) and any(alias.name.split(".")[0] == "eval" for alias in node.names)
    ]
    assert not guilty


def test_help_imports_no_heavy_package() -> None:
    code = (
        "import sys, contextlib\n"
        "from semslam.cli import main\n"
        "sys.argv = ['semslam', '--help']\n"
        "with contextlib.suppress(SystemExit): main()\n"
        "heavy = {'torch', 'open3d', 'gtsam', 'cv2', 'numpy', 'matplotlib', 'sklearn', 'evo'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_facade_gives_every_name_it_lists() -> None:
    for name in dir(semslam):
        assert getattr(semslam, name) is not None
    with pytest.raises(AttributeError, match="nonsense"):
        _ = semslam.nonsense


@pytest.mark.parametrize("package", ["semslam", "frontend", "loop", "backend", "eval"])
def test_each_package_imports_first(package: str) -> None:
    code = f"import importlib, pkgutil\npackage = importlib.import_module('{package}')\n" + (
        "for module in pkgutil.iter_modules(package.__path__, package.__name__ + '.'):\n"
        "    importlib.import_module(module.name)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
