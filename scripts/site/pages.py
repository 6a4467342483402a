"""Which files of the repository become pages of the site, and where their links lead there."""

import posixpath
from collections.abc import Mapping
from dataclasses import dataclass

from scripts.markdown_links import Link, rewritten

ROOT_PAGES = {
    "README.md": "index.md",
    "BENCHMARKS.md": "benchmarks.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "loop/segmentation/weights/MODEL_CARD.md": "model-card.md",
}
"""Pages that are written outside docs/, and their names on the site."""


@dataclass(frozen=True, slots=True)
class LinkTranslation:
    """Turns links between files of the repository into links between pages.

    Attributes:
        pages: the site's name of each file that is on it, by its path in the repository.
        repository: address of the repository; empty = not known, then links to files that are no pages become
            text, and their images are left out.
    """

    pages: Mapping[str, str]
    repository: str

    def page(self, text: str, written_at: str, shown_at: str) -> str:
        """A page's text with its links translated.

        Args:
            text: Markdown.
            written_at: the file that it stands in, relative to the repository's root.
            shown_at: the page's name on the site.
        """
        return rewritten(text, lambda link: self._translate(link, written_at, shown_at))

    def _translate(self, link: Link, written_at: str, shown_at: str) -> str:
        if not link.is_relative or not link.path:
            return f"{link.text}({link.target})"
        target = posixpath.normpath(posixpath.join(posixpath.dirname(written_at), link.path))
        anchor = f"#{link.anchor}" if link.anchor else ""
        if target in self.pages:
            return f"{link.text}({posixpath.relpath(self.pages[target], posixpath.dirname(shown_at) or '.')}{anchor})"
        if self.repository:
            return f"{link.text}({self.repository}/{'raw' if link.is_image else 'blob'}/main/{target}{anchor})"
        return "" if link.is_image else link.text.strip("[]")
