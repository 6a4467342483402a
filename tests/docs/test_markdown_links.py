"""How links are found and rewritten."""

from scripts.markdown_links import Link, anchors, links, rewritten

PAGE = """\
# A page: `code`, and more (2)

A [link](a.md#part), an image ![it](b.png), one with `code` in it: [`c`](c.py), `[none](d.md)`, [out](https://e.org).

```sh
[neither](f.md)
# no heading
```
"""


def test_finds_links_outside_code() -> None:
    assert [link.target for link in links(PAGE)] == ["a.md#part", "b.png", "c.py", "https://e.org"]


def test_knows_what_a_link_is() -> None:
    link, image, _, out = links(PAGE)
    assert (link.path, link.anchor, link.is_relative) == ("a.md", "part", True)
    assert image.is_image
    assert not out.is_relative


def test_rewrites_links_and_nothing_else() -> None:
    def change(link: Link) -> str:
        return f"<{link.target}>"

    assert rewritten(PAGE, change) == PAGE.replace("[link](a.md#part)", "<a.md#part>").replace(
        "![it](b.png)", "<b.png>"
    ).replace("[`c`](c.py)", "<c.py>").replace("[out](https://e.org)", "<https://e.org>")


def test_forms_anchors_as_the_hosts_do() -> None:
    assert anchors(PAGE) == {"a-page-code-and-more-2"}


def test_a_link_may_begin_on_one_line_and_end_on_the_next() -> None:
    page = "See [what\nit is](a.md).\n\nA [ bracket.\n\nAnother ](b.md).\n"
    assert [link.target for link in links(page)] == ["a.md"]
    assert rewritten(page, lambda link: f"<{link.target}>") == page.replace("[what\nit is](a.md)", "<a.md>")
