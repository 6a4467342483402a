"""Options that several commands share."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam import plugins
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.config import Config

MOST = 2**31 - 1
RUNS = Path("runs")
SEQUENCE_HELP = (
    "A sequence: a folder (TUM, 7-Scenes, Replica, ... see docs/datasets.md), a .bag or .mcap, or synthetic:..."
)
Sequence = Annotated[str, typer.Argument(help=SEQUENCE_HELP)]


def completer(known: Callable[[], list[str]]) -> Callable[[str], list[str]]:
    """Complete a name, or the last one of several joined by commas."""

    def complete(incomplete: str) -> list[str]:
        before, comma, begun = incomplete.rpartition(",")
        return [f"{before}{comma}{name}" for name in known() if name.startswith(begun)]

    return complete


def completion(group: plugins.Group) -> Callable[[str], list[str]]:
    """Complete the names of a group, plug-ins' included."""
    return completer(lambda: plugins.names(group))


Odometry = Annotated[
    str | None,
    typer.Option(
        "--odometry",
        help=f"Odometry: {', '.join(plugins.ODOMETRIES)}, or a plug-in's.",
        autocompletion=completion("semslam.odometry"),
    ),
]
Detector = Annotated[
    str | None,
    typer.Option(
        "--detector",
        help=f"Loop detector: {', '.join(plugins.DETECTORS)}, or a plug-in's; 'none' for no loops.",
        autocompletion=completion("semslam.detectors"),
    ),
]
Detectors = Annotated[
    str,
    typer.Option(
        "--detectors",
        help=f"Loop detectors joined by commas: {', '.join(plugins.DETECTORS)}, or plug-ins'.",
        autocompletion=completion("semslam.detectors"),
    ),
]
Loader = Annotated[
    str | None,
    typer.Option(
        "--loader",
        help=f"Dataset loader: {', '.join(plugins.DATASETS)}; guessed from the path by default.",
        autocompletion=completion("semslam.datasets"),
    ),
]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="YAML settings (see 'semslam config').")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="A setting, section.key=value; may be repeated.")]
Seed = Annotated[int | None, typer.Option("--seed", min=0, max=2**31 - 1, help="Seed of everything random.")]
Start = Annotated[int, typer.Option("--start", min=0, max=MOST, help="First frame.")]
MaxFrames = Annotated[int | None, typer.Option("--max-frames", min=1, max=MOST, help="Maximum number of frames.")]
Stride = Annotated[int, typer.Option("--stride", min=1, max=MOST, help="Take every n-th frame.")]
Inject = Annotated[
    str | None,
    typer.Option("--inject", help="Faults put into the sequence: black=30-60,drop=0.1,seed=1 (see docs/datasets.md)."),
]
Plots = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw plots and the report.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")]


def finite(value: float) -> float:
    """Refuse a number that is none: NaN lies within any range."""
    if not math.isfinite(value):
        raise typer.BadParameter("it must be a finite number.")
    return value


def finite_or_none(value: float | None) -> float | None:
    """The same for a number that may be left out."""
    return None if value is None else finite(value)


def settings(
    config: "Path | Config | None" = None,
    overrides: list[str] | None = None,
    odometry: str | None = None,
    detector: str | None = None,
    seed: int | None = None,
    loader: str | None = None,
    start: int = 0,
    max_frames: int | None = None,
    stride: int = 1,
) -> "Config":
    """Join the settings (a file's, or such as are loaded), ``--set`` texts and the named options, the later winning."""
    from semslam.config import Config, load_config, parse_overrides

    changes = parse_overrides(overrides or [])
    loaded = config.with_changes(**changes) if isinstance(config, Config) else load_config(config, changes)
    named = {"odometry": odometry, "detector": detector, "seed": seed}
    frames = {
        "loader": loader,
        "start": start or None,
        "max_frames": max_frames,
        "stride": stride if stride > 1 else None,
    }
    return loaded.with_changes(
        **{key: value for key, value in named.items() if value is not None},
        dataset={key: value for key, value in frames.items() if value is not None},
    )


def detector_names(text: str) -> list[str]:
    """Split names joined by commas.

    Raises:
        ConfigError: there is none, one stands there twice, or one is unknown.
    """
    from semslam.plugins import load

    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names or len(set(names)) != len(names):
        raise ConfigError("Name at least one detector, and each only once.")
    for name in names:
        load("semslam.detectors", name)
    return names
