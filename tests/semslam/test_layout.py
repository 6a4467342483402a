"""Rules of the house that no linter checks."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


SIBLINGS = {"frontend", "loop", "backend", "eval"}


def _imported(tree: ast.AST) -> set[str]:
    """First parts of the names of all modules that a file imports."""
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None and not node.level:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("folder", ["semslam", *sorted(SIBLINGS), "tests", "benchmarks", "examples"])
def test_no_file_imports_a_sibling_by_its_bare_name(folder: str) -> None:
    guilty = [
        str(path)
        for path in (ROOT / folder).rglob("*.py")
        if SIBLINGS & _imported(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert not guilty


@pytest.mark.parametrize("name", sorted(SIBLINGS))
def test_the_siblings_are_linked_into_the_one_package(name: str) -> None:
    link = ROOT / "semslam" / name
    assert link.is_symlink()
    assert link.readlink() == Path("..") / name


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


@pytest.mark.parametrize("package", ["semslam", *(f"semslam.{name}" for name in sorted(SIBLINGS))])
def test_each_package_imports_first(package: str) -> None:
    code = f"import importlib, pkgutil\npackage = importlib.import_module('{package}')\n" + (
        "for module in pkgutil.iter_modules(package.__path__, package.__name__ + '.'):\n"
        "    importlib.import_module(module.name)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
