"""Topics of the drivers in use, sorted by role and namespace."""

from dataclasses import dataclass

import pytest

from semslam.datasets.ros_topics import Role, choose_camera, choose_color, choose_depth, is_registered, role_of


@dataclass(frozen=True)
class Known:
    topic: str
    msgcount: int = 40


@pytest.mark.parametrize(
    ("topic", "role"),
    [
        ("/camera/rgb/image_color", Role.COLOR),
        ("/camera/color/image_raw/compressed", Role.COLOR),
        ("/device_0/sensor_1/Color_0/image/data", Role.COLOR),
        ("/device_0/sensor_0/Depth_0/image/data", Role.DEPTH),
        ("/device_0/sensor_0/Infrared_1/image/data", Role.OTHER),
        ("/camera/aligned_depth_to_color/image_raw", Role.DEPTH),
        ("/rgb_to_depth/image_raw", Role.COLOR),
        ("/depth_to_rgb/image_raw", Role.DEPTH),
        ("/camera/infra1/image_rect_raw", Role.OTHER),
        ("/camera/ir/image_raw", Role.OTHER),
        ("/zed/zed_node/confidence/confidence_map", Role.OTHER),
        ("/zed/zed_node/left/image_rect_color", Role.COLOR),
        ("/camera/image_raw", None),
        ("/first/image_raw", None),
    ],
)
def test_roles(topic: str, role: Role | None) -> None:
    assert role_of(topic) is role


def pick(topics: list[str]) -> tuple[str, str]:
    known = [Known(topic) for topic in topics]
    color = choose_color(known)[0].topic
    return color, choose_depth(known, color)[0].topic


def test_depth_of_the_colour_cameras_device_is_taken() -> None:
    color, depth = pick(["/cam1/depth/image", "/cam2/color/image", "/cam2/depth/image", "/cam2/ir/image"])
    assert (color, depth) == ("/cam2/color/image", "/cam2/depth/image")


def test_registered_depth_comes_first() -> None:
    _, depth = pick(["/c/depth/image_raw", "/c/depth_registered/image_raw", "/c/color/image_raw"])
    assert depth == "/c/depth_registered/image_raw"
    assert is_registered(depth)


def test_raw_images_come_before_compressed_ones() -> None:
    topics = ["/c/color/image_raw/compressed", "/c/color/image_raw", "/c/depth/image/compressedDepth", "/c/depth/image"]
    assert pick(topics) == ("/c/color/image_raw", "/c/depth/image")


def test_a_camera_without_a_named_colour_will_do() -> None:
    assert pick(["/camera/image_raw", "/camera/depth/image"])[0] == "/camera/image_raw"


@pytest.mark.parametrize(
    ("color", "infos", "chosen"),
    [
        (
            "/device_0/sensor_1/Color_0/image/data",
            ["/device_0/sensor_0/Depth_0/info/camera_info", "/device_0/sensor_1/Color_0/info/camera_info"],
            "/device_0/sensor_1/Color_0/info/camera_info",
        ),
        (
            "/camera/rgb/image_color/compressed",
            ["/camera/depth/camera_info", "/camera/rgb/camera_info"],
            "/camera/rgb/camera_info",
        ),
        ("/camera/color/image_raw", ["/camera/aligned_depth_to_color/camera_info", "/camera/color/camera_info"],
         "/camera/color/camera_info"),
        ("/camera/image", ["/camera/depth/camera_info"], "/camera/depth/camera_info"),
    ],
)  # fmt: skip
def test_the_camera_is_that_of_colour(color: str, infos: list[str], chosen: str) -> None:
    found = choose_camera([Known(info) for info in infos], color)
    assert found is not None
    assert found.topic == chosen
    assert choose_camera([], color) is None
