"""The commands joined, and what happens when one of them fails."""

import os
import signal
import sys
import warnings
from typing import TextIO

import typer

from semslam import __version__
from semslam.cli import (
    checks,
    environment,
    exports,
    graphs,
    live,
    maps,
    merging,
    models,
    pictures,
    runs,
    scores,
    sensors,
    sweeps,
    vslamlab,
)
from semslam.cli.console import complain, remark, shown
from semslam.errors import SemslamError, SemslamWarning
from semslam.runtime.stopping import Ended, end_on_signals

INTERRUPTED = 130
FAILED = 2

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="RGB-D SLAM whose loop closures come from semantics.",
    epilog="Examples: [bold]semslam demo[/bold]   [bold]semslam run rgbd_dataset_freiburg1_room[/bold]   "
    "[bold]semslam compare DIR --detectors none,semantic[/bold]",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"semslam {__version__}")
        raise typer.Exit


@app.callback()
def root(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    """RGB-D SLAM whose loop closures come from semantics."""


MODULES = (
    runs, live, sweeps, checks, pictures, scores, exports, maps, merging, graphs, models, sensors, vslamlab,
    environment
)  # fmt: skip
for module in MODULES:
    for command in module.COMMANDS:
        app.command(command.name, help=command.help, epilog=command.epilog)(command.run)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of our own as its sentence, others with the line they come from."""
    if issubclass(category, SemslamWarning):
        remark(str(message))
    else:
        text = shown(warnings.formatwarning(message, category, filename, lineno, line))
        print(text, end="", file=file or sys.stderr)


def main() -> None:
    """Run the command line; what a user can correct ends in one sentence and exit code 2, Ctrl-C in 130."""
    try:
        with warnings.catch_warnings(), end_on_signals():
            warnings.showwarning = _show_warning
            app()
    except SemslamError as error:
        complain(str(error))
        sys.exit(FAILED)
    except Ended as error:
        complain("Interrupted.")
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        complain("Interrupted.")
        sys.exit(INTERRUPTED)
    except ImportError as error:
        ended = _interruption(error)
        if ended is None:
            raise
        complain("Interrupted.")
        sys.exit(ended.exit_code if isinstance(ended, Ended) else INTERRUPTED)
    except BrokenPipeError:
        # The reader of a pipe has gone; print nothing more, not even while Python closes standard output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(128 + signal.SIGPIPE)
    except OSError as error:
        complain(f"{error.filename or 'A file'}: {(error.strerror or str(error)).lower()}.")
        sys.exit(FAILED)
    except MemoryError:
        complain("There is not enough memory for this; try --max-frames or a larger machine.")
        sys.exit(FAILED)


def _interruption(error: BaseException) -> Ended | KeyboardInterrupt | None:
    """The signal that an import failed of, where that is what it failed of: some libraries hide it."""
    reason: BaseException | None = error
    while reason is not None and not isinstance(reason, Ended | KeyboardInterrupt):
        reason = reason.__cause__ or reason.__context__
    return reason
