"""Each target hands bytes to a reader, as the file that it reads; whatever is not an error of ours is a fault."""

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from semslam.backend.graph.g2o import read_g2o
from semslam.config import load_config, load_saved_config, parse_faults, parse_overrides
from semslam.datasets import open_dataset
from semslam.datasets.camera_file import read_camera
from semslam.datasets.images import DepthScale, read_color, read_depth, read_labels
from semslam.datasets.trajectory_formats import read_poses
from semslam.errors import DatasetError, SemslamError
from semslam.eval.pairs.reader import read_pair_folder
from semslam.files import read_arrays
from semslam.loop.segmentation.network.checkpoint import read_tensors
from semslam.runs.inliers import read_inliers
from semslam.runs.journal import read_journal
from semslam.runs.manifest import read_manifest, seal
from semslam.runs.recording import read_recording
from semslam.runs.results import read_ledger, read_metrics, read_run
from semslam.studies.sweep.suite import read_suite

CAMERA = "width: 8\nheight: 6\nfx: 8\nfy: 8\ncx: 3.5\ncy: 2.5\ndepth_scale: 1000\n"
SMALL = 64
Read = Callable[[Path, bytes], object]


@dataclass(frozen=True, slots=True)
class Target:
    """A reader of one kind of input.

    Attributes:
        read: takes an empty folder and the bytes.
        seeds: a few sound inputs, from which damaged ones are made.
    """

    read: Read
    seeds: tuple[bytes, ...]

    def __call__(self, folder: Path, data: bytes) -> None:
        """Read; errors of ours are what should come of bad input.

        Raises:
            Exception: anything else, which is the fault that is looked for.
        """
        with contextlib.suppress(SemslamError):
            self.read(folder, data)


def _file(name: str, read: Callable[[Path], object]) -> Read:
    """Reads the bytes as a file of that name."""

    def call(folder: Path, data: bytes) -> object:
        (folder / name).write_bytes(data)
        return read(folder / name)

    return call


def _text(read: Callable[[str], object]) -> Read:
    """Reads the bytes as a text of the command line."""
    return lambda _folder, data: read(data.decode("utf-8", "surrogateescape"))


def _sequence(listing: str) -> Read:
    """Opens a folder in which one list consists of the bytes, and reads its first frame."""

    def call(folder: Path, data: bytes) -> object:
        for kind, value in (("rgb", np.zeros((6, 8, 3), np.uint8)), ("depth", np.full((6, 8), 1500, np.uint16))):
            (folder / kind).mkdir(exist_ok=True)
            cv2.imwrite(str(folder / kind / "1.png"), value)
            (folder / f"{kind}.txt").write_text(f"1.0 {kind}/1.png\n")
        (folder / "camera.yaml").write_text(CAMERA)
        (folder / listing).write_bytes(data)
        return open_dataset(folder).frame(0)

    return call


def _sealed(name: str, read: Callable[[Path], object]) -> Read:
    """Reads a run folder in which one file consists of the bytes, and whose manifest says that it should."""

    def call(folder: Path, data: bytes) -> object:
        for path in folder.iterdir():
            path.unlink()
        if name != "metrics.json":
            (folder / name).write_bytes(data)
        seal(folder, data.decode("latin-1") if name == "metrics.json" else "{}")
        return read(folder)

    return call


def _manifest(folder: Path, data: bytes) -> object:
    (folder / "metrics.json").write_text("{}")
    (folder / "manifest.json").write_bytes(data)
    return read_manifest(folder)


def _encoded(extension: str, image: np.ndarray) -> bytes:
    return bytes(cv2.imencode(extension, image)[1])


def _arrays(**values: np.ndarray) -> bytes:
    import io

    stream = io.BytesIO()
    np.savez(stream, **values)
    return stream.getvalue()


PICTURE = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)
EDGE = b"EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 " + b" ".join([b"1", b"0", b"0", b"0", b"0", b"0"] * 3) + b" 1 0 1\n"
TARGETS: Mapping[str, Target] = {
    "camera": Target(_file("camera.yaml", read_camera), (CAMERA.encode(), b"Camera.fx: 500\nCamera.fy: 500\n")),
    "settings": Target(
        _file("settings.yaml", load_config), (b"seed: 1\nloops: {min_gap: 2}\n", b"a: &a [*a]\n", b"dataset:\n  fps: 2")
    ),
    "saved_settings": Target(_file("config.yaml", load_saved_config), (b"seed: 1\nold: {gone: 2}\n",)),
    "override": Target(
        _text(lambda text: load_config(None, parse_overrides([text]))),
        (b"loops.min_gap=2", b"dataset.camera=[1, {a: 2}]"),
    ),
    "faults": Target(_text(parse_faults), (b"black=30-60,drop=0.1,seed=1",)),
    "trajectory": Target(
        _file("poses.txt", read_poses),
        (b"# t\n1.0 0 0 0 0 0 0 1\n2,0 1 0 0 0 0 0 1 5\n", b"1000000000,0,0,0,1,0,0,0\n", b"1 0 0 0 0 1 0 0 0 0 1 0\n"),
    ),
    "rgb_list": Target(_sequence("rgb.txt"), (b"# colour\n1.0 rgb/1.png\n", b"1000000000000000000 rgb/1.png\n")),
    "associations": Target(_sequence("associations.txt"), (b"1.0 rgb/1.png 1.0 depth/1.png\n",)),
    "truth": Target(_sequence("groundtruth.txt"), (b"1.0 0 0 0 0 0 0 1\n",)),
    "color": Target(
        _file("1.img", read_color), (_encoded(".png", PICTURE), _encoded(".jpg", PICTURE), _encoded(".bmp", PICTURE))
    ),
    "depth": Target(
        _file("1.img", lambda path: read_depth(path, DepthScale(1000.0))),
        (_encoded(".png", PICTURE[..., 0].astype(np.uint16)), _encoded(".tiff", PICTURE[..., 0].astype(np.float32))),
    ),
    "labels": Target(_file("1.png", read_labels), (_encoded(".png", PICTURE[..., 0]),)),
    "graph": Target(
        _file("graph.g2o", read_g2o),
        (b"VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n" + EDGE, b"FIX 0\n" + EDGE),
    ),
    "bag": Target(_file("1.bag", open_dataset), (b"#ROSBAG V2.0\n" + bytes(64),)),
    "arrays": Target(
        _file("1.npz", lambda path: read_arrays(path, "The file", DatasetError)),
        (_arrays(a=np.eye(3), b=np.arange(4)),),
    ),
    "recording": Target(
        _file("frontend.npz", lambda path: read_recording(path.parent)), (_arrays(index=np.arange(2)),)
    ),
    "inliers": Target(
        _file("inliers.npz", lambda path: read_inliers(path.parent)),
        (_arrays(entries=np.zeros(1, np.int64), counts=np.ones(1, np.int64), pixels=np.ones((1, 4), np.float32)),),
    ),
    "weights": Target(_file("1.pt", read_tensors), (b"PK\x03\x04" + bytes(40),)),
    "journal": Target(_file("journal", read_journal), (b"\x02\x00\x00\x00\xbd\x9fi\xb4H{",)),
    "manifest": Target(_manifest, (b'{"kind": "semslam run", "version": "1", "files": {}, "checksum": ""}',)),
    "metrics": Target(_sealed("metrics.json", read_metrics), (b'{"sequence": "a", "frames": 1}',)),
    "ledger": Target(_sealed("loops.jsonl", read_ledger), (b'{"query": 1, "match": 0, "score": 0.5}\n',)),
    "run": Target(_sealed("config.yaml", read_run), (b"seed: 1\n",)),
    "suite": Target(
        _file("suite.yaml", lambda path: read_suite(str(path))), (b"name: a\nsequences: [{name: b, path: c}]\n",)
    ),
    "pairs": Target(
        _file("pairs.csv", lambda path: read_pair_folder(path.parent)),
        (b"group,query,match,same\nlight,a.png,b.png,1\n",),
    ),
    "scene": Target(
        _text(lambda text: open_dataset(f"synthetic:{text[:SMALL]}")), (b"room?frames=2&width=32", b"house?seed=1")
    ),
}
