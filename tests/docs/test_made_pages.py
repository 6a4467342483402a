"""The pages that are made from the code and from files outside docs/."""

import json
from pathlib import Path

import pytest

from scripts.site import commands, notebook, settings
from scripts.site.pages import LinkTranslation
from semslam.config import Config

PAGES = {"docs/faq.md": "faq.md", "README.md": "index.md"}


@pytest.mark.parametrize("name", sorted(commands.COMMANDS))
def test_a_command_shows_usage_help_and_every_option(name: str) -> None:
    page = commands.page(name)
    command = commands.COMMANDS[name]
    assert f"semslam {name}" in page
    assert command.help in page
    for parameter in command.params:
        assert all(f"`{option}" in page for option in parameter.opts if option.startswith("--"))


def test_a_command_shows_what_is_written_of_it() -> None:
    assert "## More about it" in commands.page("run")
    assert "interrupted" in commands.page("run")
    assert "## semslam run" not in commands.overview()


def test_every_setting_has_a_row() -> None:
    page = settings.page()
    for section, values in Config().model_dump().items():
        for key in values if isinstance(values, dict) else ():
            assert f"`{section}.{key}" in page


def test_a_table_of_settings_states_defaults_and_meanings() -> None:
    assert "| `semantic_paper.min_cosine` | `0.999` | cosine" in settings.table("semantic_paper")
    assert "`semantic.nodes.min_area`" in settings.table("semantic")


def test_a_notebook_shows_code_and_outputs(tmp_path: Path) -> None:
    cells = [
        {"cell_type": "markdown", "source": ["# Title"]},
        {
            "cell_type": "code",
            "source": ["draw()"],
            "outputs": [{"data": {"image/png": "AAAA\n"}}, {"text": ["two\n"]}],
        },
    ]
    (tmp_path / "n.ipynb").write_text(json.dumps({"cells": cells}))
    page = notebook.as_markdown(tmp_path / "n.ipynb")
    assert page.startswith("# Title\n")
    assert "```python\ndraw()\n```" in page
    assert "(data:image/png;base64,AAAA)" in page
    assert "```text\ntwo\n```" in page


@pytest.mark.parametrize(
    ("repository", "source", "image"),
    [
        ("", "code", ""),
        (
            "https://host.example/s",
            "[code](https://host.example/s/blob/main/a.py)",
            "![x](https://host.example/s/raw/main/b.png)",
        ),
    ],
)
def test_links_lead_to_pages_or_to_the_repository(repository: str, source: str, image: str) -> None:
    text = "[faq](docs/faq.md#part) [code](a.py) ![x](b.png) [here](#there) [out](https://e.example)"
    shown = LinkTranslation(PAGES, repository).page(text, "README.md", "index.md")
    assert shown == f"[faq](faq.md#part) {source} {image} [here](#there) [out](https://e.example)"


def test_links_are_relative_to_the_page_that_shows_them() -> None:
    shown = LinkTranslation(PAGES, "").page("[home](../README.md)", "docs/commands.md", "commands/run.md")
    assert shown == "[home](../index.md)"
