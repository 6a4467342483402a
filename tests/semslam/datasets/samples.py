"""Small sequences in the layouts of the public benchmarks, written as their sources write them."""

import json
from pathlib import Path

import cv2
import numpy as np

COUNT = 4
SIZE = (64, 48)
OPENCV_MATRIX = "!!opencv-matrix\n{pad}   rows: {rows}\n{pad}   cols: {cols}\n{pad}   dt: d\n{pad}   data: {data}"


def color_image(index: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    rng = np.random.default_rng(index)
    return rng.integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)


def depth_image(index: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    depth = np.full((size[1], size[0]), 5000 + 100 * index, np.uint16)
    depth[:5] = 0
    return depth


def write_image(file: Path, image: np.ndarray) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(file), image)


def pose_text(index: int) -> str:
    return f"1.000000 0.000000 0.000000 {index:.6f}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"


def make_replica(folder: Path) -> Path:
    """The scene's folder; the camera lies above it, as in the archive."""
    scene = folder / "Replica" / "room0"
    for i in range(COUNT):
        write_image(scene / f"results/frame{i:06d}.jpg", color_image(i))
        write_image(scene / f"results/depth{i:06d}.png", depth_image(i))
    (scene / "traj.txt").write_text("".join(" ".join(pose_text(i).split()) + "\n" for i in range(COUNT)))
    camera = {"w": 64, "h": 48, "fx": 60.0, "fy": 60.0, "cx": 31.5, "cy": 23.5, "scale": 6553.5}
    (scene.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return scene


def make_scannet(folder: Path, color_size: tuple[int, int] = (128, 96)) -> Path:
    scene = folder / "scene0000_00"
    for i in range(COUNT):
        write_image(scene / f"color/{i}.jpg", cv2.resize(color_image(i), color_size, interpolation=cv2.INTER_NEAREST))
        write_image(scene / f"depth/{i}.png", depth_image(i))
        (scene / "pose").mkdir(exist_ok=True)
        (scene / f"pose/{i}.txt").write_text(pose_text(i) if i else "-inf -inf -inf -inf\n" * 4)
    (scene / "intrinsic").mkdir()
    for name, scale in (("color", color_size[0] / 64), ("depth", 1)):
        K = np.diag([60.0 * scale, 60.0 * scale, 1, 1])
        K[:2, 2] = (32 * scale - 0.5, 24 * scale - 0.5)
        np.savetxt(scene / f"intrinsic/intrinsic_{name}.txt", K, fmt="%f")
        np.savetxt(scene / f"intrinsic/extrinsic_{name}.txt", np.eye(4), fmt="%f")
    return scene


def make_tartanair(folder: Path) -> Path:
    """The camera drives forward, which is x in its poses."""
    sequence = folder / "abandonedfactory" / "P000"
    for i in range(COUNT):
        write_image(sequence / f"image_left/{i:06d}_left.png", color_image(i))
        (sequence / "depth_left").mkdir(exist_ok=True)
        np.save(sequence / f"depth_left/{i:06d}_left_depth.npy", depth_image(i).astype(np.float32) / 5000)
    (sequence / "pose_left.txt").write_text("".join(f"{0.1 * i} 0 0 0 0 0 1\n" for i in range(COUNT)))
    return sequence


def make_redwood(folder: Path) -> Path:
    for i in range(COUNT):
        write_image(folder / f"livingroom1-color/{i:05d}.jpg", color_image(i, (640, 480)))
        write_image(folder / f"livingroom1-depth-clean/{i:05d}.png", depth_image(i, (640, 480)))
    log = "".join(f"{i} {i} {i + 1}\n{pose_text(i)}" for i in range(COUNT))
    (folder / "livingroom1-traj.txt").write_text(log)
    return folder


def make_openloris(folder: Path) -> Path:
    """The camera looks where the robot's x points, half a metre above it."""
    sequence = folder / "office1-1"
    rows: dict[str, str] = {"color": "#Time Name\n", "aligned_depth": "#Time Name\n", "groundtruth": "#Time p q\n"}
    for i in range(COUNT):
        for kind, image in (("color", color_image(i)), ("aligned_depth", depth_image(i))):
            name = f"{kind}/{1560000000 + i / 30:.6f}.png"
            write_image(sequence / name, image)
            rows[kind] += f"{1560000000 + i / 30:.6f} {name}\n"
        rows["groundtruth"] += f"{1560000000 + i / 30:.6f} {i} 0 0 0 0 0 1\n"
    for name, text in rows.items():
        (sequence / f"{name}.txt").write_text(text)
    (sequence / "depth.txt").write_text("#Time Name\n1560000000.0 depth/1560000000.0.png\n")
    intrinsics = OPENCV_MATRIX.format(pad="   ", rows=1, cols=4, data="[ 60., 31.5, 61., 23.5 ]")
    camera = f"d400_color_optical_frame:\n   width: 64\n   height: 48\n   model: pinhole\n   intrinsics: {intrinsics}\n"
    (sequence / "sensors.yaml").write_text(f"%YAML:1.0\n---\n{camera}")
    matrix = OPENCV_MATRIX.format(
        pad="      ", rows=4, cols=4, data="[ 0., 0., 1., 0., -1., 0., 0., 0., 0., -1., 0., 0.5, 0., 0., 0., 1. ]"
    )
    entry = (
        f"   -\n      parent_frame: base_link\n      child_frame: d400_color_optical_frame\n      matrix: {matrix}\n"
    )
    (sequence / "trans_matrix.yaml").write_text(f"%YAML:1.0\n---\ntrans_matrix:\n{entry}")
    return sequence


def make_vslam_lab(folder: Path, distortion: str = "") -> Path:
    """The body is half a metre before the camera."""
    sequence = folder / "RGBDTUM" / "some_desk"
    frames = ["ts_rgb_0 (ns),path_rgb_0,ts_depth_0 (ns),path_depth_0"]
    truth = ["ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw"]
    for i in range(COUNT):
        stamp = 1305031102175304000 + i * 33333333
        write_image(sequence / f"rgb_0/{i}.png", color_image(i))
        write_image(sequence / f"depth_0/{i}.png", depth_image(i))
        frames.append(f"{stamp},rgb_0/{i}.png,{stamp},depth_0/{i}.png")
        truth.append(f"{stamp},{i},0,0,0,0,0,1")
    (sequence / "rgb.csv").write_text("\n".join(frames) + "\n")
    (sequence / "groundtruth.csv").write_text("\n".join(truth) + "\n")
    T_BS = ", ".join(f"{x:.13f}" for x in np.eye(4).ravel()[:11]) + ", -0.5, 0, 0, 0, 1.0"
    (sequence / "calibration.yaml").write_text(
        "%YAML 1.2\n---\ncameras:\n"
        "  - {cam_name: rgb_0,\n     cam_type: rgb+depth,\n     depth_name: depth_0,\n     cam_model: pinhole,\n"
        f"{distortion}     focal_length: [60.0, 60.0],\n     principal_point: [31.5, 23.5],\n"
        "     depth_factor: 5000.0,\n     image_dimension: [64, 48],\n     fps: 30.0,\n"
        f"     T_BS: [{T_BS}] # Sensor extrinsics wrt. the body-frame.\n    }}\n"
    )
    (sequence / "rgb.txt").write_text("")
    return sequence


def make_eth3d(folder: Path) -> Path:
    """A sequence of the SLAM benchmark: TUM's lists and a calibration in a line of its own."""
    sequence = folder / "cables_1"
    rows = {"rgb": "", "depth": "", "groundtruth": "# timestamp tx ty tz qx qy qz qw\n"}
    for i in range(COUNT):
        stamp = f"{4300.75 + i / 27.1:.6f}"
        write_image(sequence / f"rgb/{stamp}.png", color_image(i))
        write_image(sequence / f"depth/{stamp}.png", depth_image(i))
        rows["rgb"] += f"{stamp} rgb/{stamp}.png\n"
        rows["depth"] += f"{stamp} depth/{stamp}.png\n"
        rows["groundtruth"] += f"{stamp} {i} 0 0 0 0 0 1\n"
    for name, text in rows.items():
        (sequence / f"{name}.txt").write_text(text)
    (sequence / "calibration.txt").write_text("60.5 60.25 31.5 23.5\n")
    return sequence
