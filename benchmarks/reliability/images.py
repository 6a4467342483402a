"""Sequences that are damaged: faults of ``--inject``, and files that are not what they should be."""

import os
import shutil
import struct
import zlib
from pathlib import Path

from benchmarks.reliability.bench import Bench, Done, UnexpectedOutcomeError, saved
from benchmarks.reliability.table import Collector

injected = Collector("Faults of `semslam run --inject`")
inputs = Collector("Files are not what they should be")
ALONE = ("--detector", "none")
SPECS = {
    "drop=0.2,seed=1": "a fifth of the frames is missing",
    "gaps=0.5-1": "no frame for half a second",
    "unreadable=0.2,seed=1": "a fifth of the images cannot be read",
    "black=0.5-1": "black colour images for half a second",
    "blur=0.5-1": "strong motion blur for half a second",
    "frozen=0.5-1": "the same image for half a second",
    "no_depth=0.5-1": "no depth for half a second",
    "nan_depth=0-2": "half of the depth values are NaN",
}
NOTHING = {
    "black=0-100": "all colour images are black",
    "no_depth=0-100": "all depth images are empty",
    "unreadable=0.99,seed=1": "nearly no image can be read",
}


def _add(spec: str, words: str) -> None:
    @injected.fault(f"{words} (`{spec}`)")
    def inject(bench: Bench) -> str:
        out = bench.new()
        bench.run(out, *ALONE, "--inject", spec).expect(0)
        metrics = saved(out)
        bench.check_log(out, "put in on purpose")
        lost = metrics.frames - metrics.tracked - metrics.unreadable
        return f"exit code 0; of {metrics.frames} frames {metrics.unreadable} are left out and {lost} lost, all counted"


def _add_nothing(spec: str, words: str) -> None:
    @injected.fault(f"{words} (`{spec}`)")
    def inject(bench: Bench) -> str:
        out = bench.new()
        done = bench.run(out, *ALONE, "--inject", spec).expect(3)
        saved(out)
        return f"exit code 3, results are written: {done.sentence}"


for _spec, _words in SPECS.items():
    _add(_spec, _words)
for _spec, _words in NOTHING.items():
    _add_nothing(_spec, _words)


@injected.fault("the reader raises an error of another library in the middle (`foreign=1-2`)")
def _foreign(bench: Bench) -> str:
    out = bench.new()
    done = bench.run(out, *ALONE, "--inject", "foreign=1-2").expect(2, "What was tracked until then is in")
    return f"exit code 2, {saved(out).tracked} frames are written: {bench.shown(done.sentence)}"


@injected.fault("the same at the first frame (`foreign=0-2`)")
def _foreign_first(bench: Bench) -> str:
    out = bench.new()
    done = bench.run(out, *ALONE, "--inject", "foreign=0-2").expect(2)
    if any(out.parent.iterdir()):
        raise UnexpectedOutcomeError("Something was left behind.")
    return f"exit code 2, nothing is left behind: {done.sentence}"


def _twentieth(sequence: Path, kind: str) -> Path:
    return sorted((sequence / kind).iterdir())[20]


def _one_frame_less(bench: Bench, image: Path) -> str:
    """Run over a sequence of which one image is damaged."""
    sequence = image.parents[1]
    out = bench.new()
    bench.run(out, *ALONE, sequence=sequence).expect(0)
    metrics = saved(out)
    if (metrics.unreadable, metrics.tracked) != (1, metrics.frames - 1):
        raise UnexpectedOutcomeError(f"{metrics.unreadable} unreadable, {metrics.tracked} tracked")
    reason = next(line for line in (out / "log.txt").read_text().splitlines() if image.name in line)
    return f"exit code 0, it costs its frame alone: {bench.shown(reason)}"


@inputs.fault("an image is cut short")
def _cut(bench: Bench) -> str:
    image = _twentieth(bench.copy(), "rgb")
    os.truncate(image, 1000)
    return _one_frame_less(bench, image)


@inputs.fault("a depth image is gone")
def _gone(bench: Bench) -> str:
    image = _twentieth(bench.copy(), "depth")
    image.unlink()
    return _one_frame_less(bench, image)


@inputs.fault("a pipe in an image's place")
def _pipe(bench: Bench) -> str:
    image = _twentieth(bench.copy(), "depth")
    image.unlink()
    os.mkfifo(image)
    return _one_frame_less(bench, image)


@inputs.fault("`/dev/zero` in an image's place")
def _device(bench: Bench) -> str:
    image = _twentieth(bench.copy(), "depth")
    image.unlink()
    image.symlink_to("/dev/zero")
    return _one_frame_less(bench, image)


@inputs.fault("an image whose header states 60000 x 60000 pixels")
def _bomb(bench: Bench) -> str:
    image = _twentieth(bench.copy(), "rgb")
    header = b"IHDR" + struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    image.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk + struct.pack(">I", 0) + b"IEND\xaeB`\x82")
    return _one_frame_less(bench, image)


def _refused(bench: Bench, sequence: Path, fragment: str) -> str:
    """Run over a sequence that is refused before its first frame."""
    out = bench.new()
    done = bench.run(out, *ALONE, sequence=sequence).expect(2, fragment)
    if any(out.parent.iterdir()):
        raise UnexpectedOutcomeError("Something was left behind.")
    return f"exit code 2 before the first frame: {bench.shown(done.sentence)}"


@inputs.fault("`cx: 1e9` in camera.yaml")
def _camera(bench: Bench) -> str:
    sequence = bench.copy()
    text = (sequence / "camera.yaml").read_text().splitlines()
    changed = ["cx: 1.0e+9" if line.startswith("cx:") else line for line in text]
    (sequence / "camera.yaml").write_text("\n".join(changed))
    return _refused(bench, sequence, "cx")


@inputs.fault("a key stands twice in camera.yaml")
def _doubled(bench: Bench) -> str:
    sequence = bench.copy()
    with (sequence / "camera.yaml").open("a") as file:
        file.write("\nwidth: 640\n")
    return _refused(bench, sequence, "width")


@inputs.fault("lists that hold no text")
def _binary(bench: Bench) -> str:
    sequence = bench.copy()
    (sequence / "rgb.txt").write_bytes(bytes(range(256)) * 20)
    return _refused(bench, sequence, "rgb.txt")


@inputs.fault("depth stamps ten seconds late")
def _late(bench: Bench) -> str:
    sequence = bench.copy()
    rows = [line.split() for line in (sequence / "depth.txt").read_text().splitlines() if not line.startswith("#")]
    (sequence / "depth.txt").write_text("".join(f"{float(stamp) + 10:.6f} {name}\n" for stamp, name in rows))
    return _refused(bench, sequence, "depth image")


def _damaged(bench: Bench, name: str, content: bytes | None) -> Done:
    """Read a finished run of which one file was changed."""
    out = Path(shutil.copytree(bench.whole(), bench.new()))
    path = out / name
    path.unlink() if content is None else path.write_bytes(content)
    return bench.semslam("plot", out, "--out", bench.new("plots")).expect(2, name)


damaged = Collector("A finished run is damaged")


@damaged.fault("its settings are cut in half")
def _half_settings(bench: Bench) -> str:
    content = (bench.whole() / "config.yaml").read_bytes()
    return f"exit code 2: {bench.shown(_damaged(bench, 'config.yaml', content[: len(content) // 2]).sentence)}"


@damaged.fault("its ledger is empty")
def _empty_ledger(bench: Bench) -> str:
    return f"exit code 2: {bench.shown(_damaged(bench, 'loops.jsonl', b'').sentence)}"


@damaged.fault("a bit of its trajectory is flipped")
def _flipped(bench: Bench) -> str:
    content = bytearray((bench.whole() / "trajectory.txt").read_bytes())
    content[500] ^= 1
    return f"exit code 2: {bench.shown(_damaged(bench, 'trajectory.txt', bytes(content)).sentence)}"


@damaged.fault("its graph is gone")
def _no_graph(bench: Bench) -> str:
    return f"exit code 2: {bench.shown(_damaged(bench, 'graph.g2o', None).sentence)}"
