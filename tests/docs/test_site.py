"""The site: it builds without a warning, has a page for each command and detector, and loads nothing from outside."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from semslam import plugins

ROOT = Path(__file__).resolve().parents[2]
LOADED = re.compile(r"<(?:script|link|img|iframe|source)[^>]*?(?:src|href)=[\"']?(?:https?:)?//[^>]*>")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mkdocs", reason="the site is built by the extra 'docs' (make docs)")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_loads_nothing_from_outside(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 50
    assert not [found for page in pages for found in LOADED.findall(page.read_text("utf-8"))]


def test_each_command_has_a_page_with_its_options(site: Path) -> None:
    commands = pytest.importorskip("scripts.site.commands")
    for name in commands.COMMANDS:
        assert f"semslam {name}" in (site / "commands" / f"{name}.html").read_text("utf-8")
    assert "--detector" in (site / "commands" / "run.html").read_text("utf-8")


@pytest.mark.parametrize("name", sorted(set(plugins.DETECTORS) - {"none"}))
def test_each_detector_has_a_page_with_formulas_and_settings(name: str, site: Path) -> None:
    page = (site / "detectors" / f"{name}.html").read_text("utf-8")
    assert "<math" in page
    assert "arithmatex" not in page
    assert "<code>loops." in page or f"<code>{name.replace('-', '_')}." in page


def test_docstrings_and_the_notebook_are_shown(site: Path) -> None:
    assert "accept" in (site / "api" / "index.html").read_text("utf-8")
    assert "data:image/png" in (site / "notebook.html").read_text("utf-8")
