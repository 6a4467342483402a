"""Every relative link of every page leads to a file that is there, and to an anchor that is in it."""

from pathlib import Path

import pytest

from scripts.markdown_links import anchors, links

ROOT = Path(__file__).resolve().parents[2]


def pages() -> list[Path]:
    """The Markdown files of the repository."""
    folders = ("docs", "loop", "examples", "benchmarks", ".github")
    return sorted([*ROOT.glob("*.md"), *(page for folder in folders for page in (ROOT / folder).rglob("*.md"))])


@pytest.mark.parametrize("page", pages(), ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_resolve(page: Path) -> None:
    broken = []
    for link in links(page.read_text(encoding="utf-8")):
        if link.is_relative:
            target = (page.parent / link.path).resolve() if link.path else page
            if not target.exists():
                broken.append(f"{link.target}: no such file")
            elif link.anchor and target.suffix == ".md" and link.anchor not in anchors(target.read_text("utf-8")):
                broken.append(f"{link.target}: no such heading")
    assert not broken
