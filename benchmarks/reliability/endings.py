"""Runs that are ended, killed, or run out of disk."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.reliability.bench import (
    Bench,
    UnexpectedOutcomeError,
    bytes_in,
    disk,
    ended,
    fill,
    journal_of,
    results_of,
    saved,
    wait_for,
)
from benchmarks.reliability.table import Collector

endings = Collector("A run is ended")
kills = Collector("A run is killed, and gone on with by `semslam run --resume`")
disks = Collector("The disk is full")
SAME = "resumed to the bytes of an undisturbed run"
SIGNALS = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM", signal.SIGHUP: "SIGHUP"}
Moment = Callable[[Path], bool]


def tracking(out: Path) -> bool:
    """Whether some frames have been tracked."""
    return bytes_in(journal_of(out)) > 15_000


def writing(out: Path) -> bool:
    """Whether results are being written."""
    return results_of(out).exists()


def disturbed(bench: Bench, out: Path, moment: Moment, *numbers: int) -> int:
    """Start a run, send it signals at a moment, and return its exit code."""
    process = bench.start(*bench.words(out))
    wait_for(lambda: moment(out), process)
    for number in numbers:
        os.kill(process.pid, number)
    return ended(process).code


def _end(bench: Bench, moment: Moment, times: int) -> str:
    codes = []
    for number, name in SIGNALS.items():
        out = bench.new()
        codes.append(disturbed(bench, out, moment, *[number] * times))
        metrics = saved(out)
        if codes[-1] != 128 + number or metrics.interrupted != (moment is tracking) or not metrics.tracked:
            raise UnexpectedOutcomeError(f"{name}: exit code {codes[-1]}, {metrics.tracked} frames")
    return f"exit code {', '.join(map(str, codes))}; "


@endings.fault("Ctrl-C, SIGTERM, SIGHUP during tracking")
def _during_tracking(bench: Bench) -> str:
    return _end(bench, tracking, 1) + "the frames until then are optimised, scored and written"


@endings.fault("each of them twice at once")
def _twice(bench: Bench) -> str:
    return _end(bench, tracking, 2) + "the frames until then are optimised, scored and written"


@endings.fault("each of them while results are written")
def _during_writing(bench: Bench) -> str:
    return _end(bench, writing, 2) + "the writing is finished"


def killed(bench: Bench, moment: Moment) -> Path:
    """A run that was killed at a moment; it has left no run folder."""
    out = bench.new()
    if disturbed(bench, out, moment, signal.SIGKILL) != -signal.SIGKILL or out.exists():
        raise UnexpectedOutcomeError(f"It was not killed: {out}")
    return out


def resumed(bench: Bench, out: Path) -> str:
    """Go on with a killed run, and make sure that nothing was lost."""
    bench.semslam("run", "--resume", out).expect(0)
    bench.check_same(out)
    return SAME


@kills.fault("SIGKILL during tracking")
def _kill_tracking(bench: Bench) -> str:
    return resumed(bench, killed(bench, tracking))


@kills.fault("SIGKILL while results are written")
def _kill_writing(bench: Bench) -> str:
    return resumed(bench, killed(bench, writing))


@kills.fault("SIGKILL of the resumed run as well")
def _kill_twice(bench: Bench) -> str:
    out = killed(bench, tracking)
    process = bench.start("run", "--resume", out)
    time.sleep(2.0)
    process.kill()
    ended(process)
    return resumed(bench, out)


@kills.fault("SIGKILL of a run in real time (`--realtime`)")
def _kill_realtime(bench: Bench) -> str:
    out = bench.new()
    process = bench.start(*bench.words(out, "--realtime", "--rate", 15))
    wait_for(lambda: tracking(out), process)
    process.kill()
    ended(process)
    bench.semslam("run", "--resume", out).expect(0, "it ends with them")
    if not saved(out).tracked:
        raise UnexpectedOutcomeError("Nothing was tracked.")
    return "exit code 0; the frames until the kill are optimised, scored and written"


@kills.fault("a power cut: the journal ends within a record")
def _power_cut(bench: Bench) -> str:
    out = killed(bench, tracking)
    os.truncate(journal_of(out), bytes_in(journal_of(out)) - 100)
    return resumed(bench, out)


@kills.fault("a bit of the journal is flipped")
def _flipped(bench: Bench) -> str:
    out = killed(bench, tracking)
    content = bytearray(journal_of(out).read_bytes())
    content[-2000] ^= 1
    journal_of(out).write_bytes(content)
    return resumed(bench, out)


@kills.fault("other images than before")
def _other_images(bench: Bench) -> str:
    out, other = killed(bench, tracking), bench.copy()
    first, second = sorted((other / "rgb").iterdir())[1:3]
    second.write_bytes(first.read_bytes())
    done = bench.semslam("run", "--resume", out, other).expect(2, "differs from the journal")
    if not journal_of(out).exists():
        raise UnexpectedOutcomeError("The journal is gone.")
    return f"exit code 2: {done.sentence} The journal stays, and with the right images the run is {resumed(bench, out)}"


@kills.fault("a killed run is read as if it were finished")
def _read_unfinished(bench: Bench) -> str:
    out = killed(bench, writing)
    done = bench.semslam("ledger", f"{out}.unfinished").expect(2)
    return f"exit code 2: {bench.shown(done.sentence)}"


@disks.fault("2 MB when the run begins")
def _too_small(bench: Bench) -> str:
    with disk(bench.new("disk"), 2) as folder:
        done = bench.run(folder / "run").expect(2, "cannot be written")
        return f"exit code 2 before the first frame: {bench.shown(done.sentence)}"


def _filled(bench: Bench, moment: Moment, megabytes: int, leave: int) -> str:
    """A disk that something else fills during a run; later there is room again."""
    with disk(bench.new("disk"), megabytes) as folder:
        out = folder / "run"
        process = bench.start(*bench.words(out, "--plots"))  # drawing takes a while: the disk is full before the end
        wait_for(lambda: moment(out), process)
        filler = fill(folder, leave)
        done = ended(process).expect(2, "could not be saved")
        if out.exists():
            raise UnexpectedOutcomeError("A run folder is there, though the disk was full.")
        filler.unlink()
        return f"exit code 2: {bench.shown(done.sentence)} Once there is room it is {resumed(bench, out)}"


@disks.fault("20 MB, filled by something else during tracking")
def _filled_tracking(bench: Bench) -> str:
    return _filled(bench, tracking, 20, 0)


@disks.fault("200 MB, filled by something else while results are written")
def _filled_writing(bench: Bench) -> str:
    return _filled(bench, writing, 200, 4096)


@disks.fault("20 MB, filled for the journal alone")
def _filled_journal(bench: Bench) -> str:
    with disk(bench.new("disk"), 20) as folder:
        out = folder / "run"
        process = bench.start(*bench.words(out))
        wait_for(lambda: tracking(out), process)
        filler = fill(folder, 0)
        size = bytes_in(journal_of(out))
        time.sleep(0.3)
        filler.unlink()
        done = ended(process).expect(0)
        bench.check_log(out, "The journal could not be continued")
        if size == 0 or done.code:
            raise UnexpectedOutcomeError("There was no journal.")
        return "exit code 0: the run goes on to its end, and a remark states that it has no journal from there on"


@disks.fault("20 MB, with an earlier run of that name, filled while results are written")
def _filled_over_another(bench: Bench) -> str:
    with disk(bench.new("disk"), 20) as folder:
        out = folder / "run"
        bench.run(out).expect(0)
        process = bench.start(*bench.words(out, "--plots"))
        wait_for(lambda: writing(out), process)
        fill(folder, 4096)
        ended(process).expect(2, "could not be saved")
        bench.check_same(out)
        return "exit code 2: the earlier run stays as it was"
