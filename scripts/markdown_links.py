"""Links in Markdown: finding them, rewriting them, and the anchors that they may name."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby

LINK = re.compile(r"(?P<code>`+[^`]+`+)|(?P<text>!?\[(?:[^\[\]]|\[[^\]]*\])*\])\((?P<target>[^()\s]+)\)")
"""A link, or a piece of inline code before it, in which nothing is a link."""
FENCE = re.compile(r"^ {0,3}(```+|~~~+)")
HEADING = re.compile(r"^#{1,6} +(?P<title>.+?) *#*$")


@dataclass(frozen=True, slots=True)
class Link:
    """A link as it stands in a page.

    Attributes:
        text: what is shown, with its brackets; an image's begins with an exclamation mark.
        target: an address, or a path relative to the page, with or without ``#anchor``.
    """

    text: str
    target: str

    @property
    def is_image(self) -> bool:
        """Whether it shows a picture."""
        return self.text.startswith("!")

    @property
    def is_relative(self) -> bool:
        """Whether the target is a file beside the page or an anchor in it."""
        return not re.match(r"[a-z][a-z+.-]*:|/", self.target)

    @property
    def path(self) -> str:
        """The target without its anchor."""
        return self.target.partition("#")[0]

    @property
    def anchor(self) -> str:
        """The anchor without its sign; empty where there is none."""
        return self.target.partition("#")[2]


def links(text: str) -> list[Link]:
    """All links of a page; code is passed over."""
    return [
        Link(found["text"], found["target"])
        for block, is_code in _blocks(text)
        if not is_code
        for found in LINK.finditer(block)
        if found["target"]
    ]


def anchors(text: str) -> set[str]:
    """The anchors of a page's headings, as GitHub and Python-Markdown form them."""
    headings = [HEADING.match(line) for line, is_code in _lines(text) if not is_code]
    return {_slug(heading["title"]) for heading in headings if heading}


def rewritten(text: str, change: Callable[[Link], str]) -> str:
    """The page with each link replaced by what ``change`` returns for it; code stays as it is."""

    def replace(found: re.Match[str]) -> str:
        return found["code"] or change(Link(found["text"], found["target"]))

    return "\n".join(block if is_code else LINK.sub(replace, block) for block, is_code in _blocks(text))


def _blocks(text: str) -> Iterator[tuple[str, bool]]:
    """Lines up to an empty one together, since a link may begin on one and end on the next; code line by line."""
    for together, lines in groupby(_lines(text), lambda line: bool(line[0].strip()) and not line[1]):
        if together:
            yield "\n".join(line for line, _ in lines), False
        else:
            yield from lines


def _lines(text: str) -> Iterator[tuple[str, bool]]:
    """Each line, and whether it belongs to a block of code."""
    fence = ""
    for line in text.split("\n"):
        found = FENCE.match(line)
        is_code = bool(fence)
        if found and not fence:
            fence, is_code = found[1], True
        elif found and found[1].startswith(fence):
            fence = ""
        yield line, is_code


def _slug(title: str) -> str:
    plain = LINK.sub(lambda found: (found["text"] or found["code"]).strip("![]"), title).replace("`", "").lower()
    return re.sub(r"[^\w\- ]", "", plain).strip().replace(" ", "-")
