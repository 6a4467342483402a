"""What mkdocs calls while it builds the site (mkdocs.yml: hooks)."""

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from scripts.site import commands, notebook, settings
from scripts.site.formulas import as_mathml
from scripts.site.pages import ROOT_PAGES, LinkTranslation

ROOT = Path(__file__).parents[2]
NOTEBOOK = Path("examples/notebook.ipynb")
SETTINGS = re.compile(r"^<!-- settings: ([\w]+) -->$", re.MULTILINE)
COMMAND_PAGES = {f"commands/{name}.md": name for name in commands.COMMANDS}
_origins: dict[str, str] = {}
"""The file in the repository that each page was written in, by the page's name."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List the pages of commands, detectors and experiments, and below Guides every other page of docs/."""
    folders: dict[str, list[Any]] = {
        "Commands": ["commands.md", *({name: page} for page, name in COMMAND_PAGES.items())],
        "Detectors": ["detectors.md", *({page.stem: f"detectors/{page.name}"} for page in _written("detectors"))],
        "Experiments": [f"experiments/{page.name}" for page in _written("experiments")],
    }
    navigation = [{title: folders.get(title, pages) for title, pages in entry.items()} for entry in config.nav or []]
    listed = set(re.findall(r"[\w/-]+\.md", str(navigation)))
    for entry in navigation:
        entry.get("Guides", []).extend(page.name for page in _written(".") if page.name not in listed)
    config.nav = navigation
    return config


def _written(folder: str) -> list[Path]:
    """The pages of a folder of docs/, by name."""
    return sorted((ROOT / "docs" / folder).glob("*.md"))


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are not files of docs/."""
    made = {page: commands.page(name) for page, name in COMMAND_PAGES.items()}
    made |= {"commands.md": commands.overview(), "settings.md": settings.page()}
    made |= {"notebook.md": notebook.as_markdown(ROOT / NOTEBOOK)}
    made |= {page: (ROOT / path).read_text(encoding="utf-8") for path, page in ROOT_PAGES.items()}
    files.remove(files.src_uris["commands.md"])
    for page, text in made.items():
        files.append(File.generated(config, page, content=text))
    _origins.clear()
    _origins.update({file.src_uri: f"docs/{file.src_uri}" for file in files})
    _origins.update(dict.fromkeys(COMMAND_PAGES, commands.PROSE.as_posix()))
    _origins.update({page: path for path, page in ROOT_PAGES.items()} | {"notebook.md": NOTEBOOK.as_posix()})
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Fill in the tables that are made from the code, and lead links to pages."""
    text = SETTINGS.sub(lambda found: settings.table(found[1]), markdown)
    pages = {_origins[file.src_uri]: file.src_uri for file in files if file.src_uri not in COMMAND_PAGES}
    translation = LinkTranslation(pages, config.extra["repository"])
    return translation.page(text, _origins[page.file.src_uri], page.file.src_uri)


def on_page_content(page_html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Draw the formulas."""
    return as_mathml(page_html)
