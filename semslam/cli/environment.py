"""semslam config, doctor, download."""

import json
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated

import typer

from semslam import plugins
from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out
from semslam.cli.progress import bar
from semslam.errors import ConfigError, SemslamError

PACKAGES = (
    "numpy",
    "opencv-python-headless",
    "open3d",
    "gtsam",
    "onnxruntime",
    "scikit-learn",
    "kiss-icp",
    "evo",
)
TRAINING = "torch"
"""Needed to train the network, and by some detectors and segmenters; a run with the defaults does without."""
MODULES = {"opencv-python-headless": "cv2", "scikit-learn": "sklearn", "kiss-icp": "kiss_icp"}


def config_command(
    place: Annotated[str | None, typer.Argument(metavar="[SECTION]", help="Print this section alone.")] = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print a JSON schema for editors instead.")] = False,
) -> None:
    """Print the effective settings as YAML, each with its description, unit, range and default."""
    from semslam.config.explained import commented_yaml, json_schema

    chosen = options.settings(config, overrides)
    if schema:
        typer.echo(json.dumps(json_schema(chosen), indent=2))
    else:
        typer.echo(commented_yaml(chosen, place), nl=False)


def doctor_command() -> None:
    """Check that everything a run needs is here."""
    from semslam.config import Config

    problems: list[str] = []
    out.print(f"Python {platform.python_version()}, {platform.system()} {platform.machine()}")
    for package in PACKAGES:
        found = _import_version(package)
        out.print(f"{package}: {found}", soft_wrap=True)
        if found.startswith("missing"):
            problems.append(package)
    found = _import_version(TRAINING)
    needed = " (only needed for training and some detectors)" if found.startswith("missing") else ""
    out.print(f"{TRAINING}: {found}{needed}", soft_wrap=True)
    try:
        segmenter = plugins.load("semslam.segmenters", Config().segmentation.name).from_config(Config())
        out.print(f"segmentation network: {len(segmenter.names) - 1} classes")
    except (SemslamError, ImportError) as error:
        out.print(f"segmentation network: missing ({error})", soft_wrap=True)
        problems.append("segmentation network")
    for group in plugins.GROUPS:
        out.print(f"{group}: {', '.join(plugins.names(group))}", soft_wrap=True)
        for name, entry in plugins.outside(group).items():
            found = _check(group, name)
            out.print(f"plug-in {name} ({entry.value}): {found or 'usable'}", soft_wrap=True)
            problems += [f"plug-in {name}"] if found else []
    if problems:
        raise SemslamError(f"Not usable here: {', '.join(problems)}.")
    out.print("All is well.")


def _sequences() -> list[str]:
    from semslam.datasets.tum_names import short_names

    return short_names()


def download_command(
    name: Annotated[
        str | None,
        typer.Argument(help="A short name, such as fr1/room.", autocompletion=options.completer(_sequences)),
    ] = None,
    directory: Annotated[Path, typer.Argument(help="Folder to unpack it in.")] = Path("data"),
    base_url: Annotated[str | None, typer.Option(help="A mirror to take it from.")] = None,
    listed: Annotated[bool, typer.Option("--list", help="Print the short names of all sequences.")] = False,
) -> None:
    """Fetch a TUM RGB-D sequence; an interrupted download goes on where it stopped."""
    from semslam.datasets.download import BASE_URL, download

    if listed:
        typer.echo("\n".join(_sequences()))
        return
    if name is None:
        raise ConfigError("Name a sequence, such as fr1/room; --list prints all of them.")
    with bar(name, None, "bytes") as update:
        path = download(name, directory, progress=update, base_url=base_url or BASE_URL)
    out.print(f"Unpacked to {path}", soft_wrap=True)


def _check(group: plugins.Group, name: str) -> str:
    """Why a plug-in cannot be used; empty where it can."""
    from semslam.config.settings import check_plugin

    try:
        check_plugin(group, name)
    except ConfigError as error:
        return str(error)
    return ""


def _import_version(package: str) -> str:
    try:
        __import__(MODULES.get(package, package))
        return version(package)
    except (ImportError, OSError, PackageNotFoundError) as error:
        return f"missing ({error})"


COMMANDS = (
    Command(
        "config",
        config_command,
        "Print the effective settings as YAML, each with its description, unit, range and default.",
        example(
            "semslam config > my.yaml", "semslam config keyframes", "semslam config --schema > semslam.schema.json"
        ),
    ),
    Command("doctor", doctor_command, "Check that everything a run needs is here."),
    Command(
        "download",
        download_command,
        "Fetch a TUM RGB-D sequence by its short name.",
        example("semslam download fr1/room", "semslam download fr3/long_office data"),
    ),
)
