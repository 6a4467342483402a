"""The package as others install it: outside the checkout, beside files that are called like our folders."""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from scripts.markdown_links import links

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """\
import semslam.testing
from semslam import LoopCloser, Slam, load_config, open_dataset, run
import semslam.backend.pose_graph, semslam.eval.trajectory, semslam.frontend.keyframes, semslam.loop.detector
print(semslam.__file__)
"""
SIBLINGS = ("eval", "loop", "backend", "frontend")


def build(source: Path, target: str, out: Path, repository: str = "") -> Path:
    """Build a wheel or an sdist from a source tree."""
    pytest.importorskip("hatchling")
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(out)]
    environment = os.environ | {"SEMSLAM_REPOSITORY": repository}
    done = subprocess.run(command, cwd=source, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return next(out.iterdir())


@pytest.fixture(scope="module", params=["wheel", "sdist"])
def site(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the installed package, made from the checkout or from the sdist."""
    folder, source = tmp_path_factory.mktemp(request.param), ROOT
    if request.param == "sdist":
        with tarfile.open(build(ROOT, "sdist", folder / "sdist")) as archive:
            archive.extractall(folder / "source", filter="data")
        source = next((folder / "source").iterdir())
    with zipfile.ZipFile(build(source, "wheel", folder / "wheel")) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def python(site: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(site)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_a_users_own_modules_do_not_disturb_it(site: Path, tmp_path: Path) -> None:
    for name in SIBLINGS:
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('a user file was imported')\n")
    (tmp_path / "script.py").write_text(SCRIPT)
    done = python(site, tmp_path, "script.py")
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()) == site / "semslam" / "__init__.py"
    done = python(site, tmp_path, "-m", "semslam", "demo", "--help")
    assert done.returncode == 0, done.stderr


def test_types_weights_and_contracts_are_inside(site: Path) -> None:
    package = site / "semslam"
    assert (package / "py.typed").is_file()
    assert (package / "testing" / "odometry.py").is_file()
    assert list((package / "loop" / "segmentation" / "weights").glob("*.onnx"))
    assert not any((site / name).exists() for name in SIBLINGS)


@pytest.mark.parametrize("repository", ["", "https://host.example/semslam"])
def test_no_link_on_the_package_index_leads_nowhere(repository: str, tmp_path: Path) -> None:
    with tarfile.open(build(ROOT, "sdist", tmp_path, repository)) as archive:
        info = next(member for member in archive.getmembers() if member.name.endswith("/PKG-INFO"))
        content = archive.extractfile(info)
        assert content is not None
        text = content.read().decode("utf-8")
    assert "RGB-D SLAM whose loop closures come from semantics" in text
    assert not [link.target for link in links(text) if link.is_relative and link.path]
    assert (f"Project-URL: Repository, {repository}" in text) == bool(repository)
    assert (f"]({repository}/blob/main/docs/tutorial.md)" in text) == bool(repository)
