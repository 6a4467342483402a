"""Opening a Rerun recording: into a file, into a viewer that is started, or both."""

from importlib.util import find_spec
from pathlib import Path

from semslam.errors import ConfigError, ResultsError
from semslam.viewers.rerun_blueprint import make_blueprint
from semslam.viewers.rerun_viewer import RerunViewer

APPLICATION = "semslam"
MISSING = "The viewer needs the package rerun-sdk: pip install 'semslam[rerun]'."


def check_place(file: Path | None) -> None:
    """Check before a run that it can be shown, without loading Rerun.

    Raises:
        ConfigError: rerun-sdk is not installed.
        ResultsError: the recording cannot be written.
    """
    if find_spec("rerun") is None:
        raise ConfigError(MISSING)
    if file is not None:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.touch()
        except (OSError, ValueError) as error:
            raise ResultsError(f"{file} cannot be written: {' '.join(str(error).split())}.") from error


def open_viewer(
    name: str, file: Path | None, live: bool, finished: bool = False, semantic: bool = False
) -> RerunViewer:
    """Open a viewer.

    Args:
        name: what the recording is called in the viewer.
        file: the .rrd file that is written, or None.
        live: whether to start the viewer and stream into it.
        finished: whether the run is over, so that its outcome is looked at first.
        semantic: whether a semantic map will be shown.

    Raises:
        ConfigError: rerun-sdk is not installed.
        ResultsError: the file cannot be written, or the viewer does not start.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise ConfigError(MISSING) from error
    stream = rr.RecordingStream(APPLICATION)
    sinks: list[rr.FileSink | rr.GrpcSink] = []
    try:
        if live:
            rr.spawn(connect=False, executable_path=_program(), recording=stream)
            sinks.append(rr.GrpcSink())
        if file is not None:
            file.parent.mkdir(parents=True, exist_ok=True)
            sinks.append(rr.FileSink(file))
        stream.set_sinks(*sinks, default_blueprint=make_blueprint(finished, semantic))
    except (OSError, RuntimeError) as error:
        raise ResultsError(f"The viewer cannot be opened: {' '.join(str(error).split())}.") from error
    stream.send_recording_name(name)
    return RerunViewer(stream)


def _program() -> str | None:
    """The viewer that comes with rerun-sdk, on the search path or not; None = the one on the search path."""
    package = find_spec("rerun_cli")
    places = [] if package is None else [Path(place) for place in package.submodule_search_locations or ()]
    found = [place / name for place in places for name in ("rerun", "rerun.exe") if (place / name).is_file()]
    return str(found[0]) if found else None
