"""The network: shapes, the paper's economy, and the layers written for speed."""

import numpy as np
import pytest
import torch
import torch.nn.functional as F  # noqa: N812

from semslam.errors import ModelError
from semslam.loop.segmentation.network.checkpoint import load_network, save_weights
from semslam.loop.segmentation.network.encoder import ConvNorm
from semslam.loop.segmentation.network.fast_layers import dilated_depthwise, enlarge
from semslam.loop.segmentation.network.network import (
    build_mobilenet_deeplab,
    count_multiply_adds,
    count_parameters,
)
from semslam.loop.segmentation.network.pretrained import convert_ade20k, refresh_norms
from semslam.loop.segmentation.network.xception import build_xception_deeplab
from semslam.loop.segmentation.shipped import CHECKPOINT


@pytest.mark.parametrize("build", [build_mobilenet_deeplab, build_xception_deeplab])
def test_strides(build):
    network = build().eval()
    with torch.inference_mode():
        logits, features = network(torch.zeros(1, 3, 48, 64))
    assert logits.shape == (1, 40, 12, 16)
    assert features.shape == (1, network.encoder.middle_channels, 3, 4)


def test_mobilenet_is_the_smaller_network():
    small, large = build_mobilenet_deeplab(), build_xception_deeplab()
    assert count_parameters(small) == 2_730_456
    assert count_parameters(large) > 15 * count_parameters(small)
    assert count_multiply_adds(large, 48, 64) > 8 * count_multiply_adds(small, 48, 64)


def test_multiply_adds_of_one_convolution():
    assert count_multiply_adds(ConvNorm(3, 8, 3, stride=2), 32, 32) == 16 * 16 * 8 * 3 * 9


def test_strided_convolution_pads_bottom_right():
    layer = ConvNorm(1, 1, 3, stride=2, activate=False).eval()
    torch.nn.init.constant_(layer.conv.weight, 0.0)
    with torch.no_grad():
        layer.conv.weight[0, 0, 0, 0] = 1.0
    image = torch.arange(16.0).reshape(1, 1, 4, 4)
    expected = image[:, :, ::2, ::2] / np.sqrt(1.001)
    assert torch.allclose(layer(image), expected)


@pytest.mark.parametrize("dilation", [2, 3, 6])
def test_dilated_depthwise_equals_the_library(dilation):
    torch.manual_seed(0)
    x = torch.randn(2, 5, 9, 11, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(5, 1, 3, 3, dtype=torch.float64, requires_grad=True)
    ours = dilated_depthwise(x, weight, dilation)
    theirs = F.conv2d(x, weight, None, 1, dilation, dilation, 5)
    outer = torch.randn_like(theirs)
    assert torch.allclose(ours, theirs)
    for a, b in zip(
        torch.autograd.grad(ours, (x, weight), outer), torch.autograd.grad(theirs, (x, weight), outer), strict=True
    ):
        assert torch.allclose(a, b)


@pytest.mark.parametrize("factor", [2, 4])
def test_enlarge_equals_the_library(factor):
    x = torch.randn(2, 3, 5, 7)
    assert torch.allclose(enlarge(x, factor), F.interpolate(x, scale_factor=factor, mode="bilinear"), atol=1e-5)


def test_refreshed_norms_leave_the_function_and_hold_the_statistics():
    torch.manual_seed(0)
    network, images = build_mobilenet_deeplab().eval(), torch.randn(2, 3, 48, 64)
    before = network(images)[0]
    refresh_norms(network, images)
    assert torch.allclose(network(images)[0], before, atol=1e-4)
    norm = network.encoder.stem.norm
    seen = network.encoder.stem.conv(F.pad(images, (0, 1, 0, 1)))
    assert torch.allclose(norm.running_mean, seen.mean((0, 2, 3)), atol=1e-5)


def test_checkpoint_round_trip_is_float16(tmp_path):
    network = build_mobilenet_deeplab()
    save_weights(network, tmp_path / "w.pt")
    other = load_network(tmp_path / "w.pt")
    for a, b in zip(network.state_dict().values(), other.state_dict().values(), strict=True):
        assert torch.allclose(a.float(), b.float(), rtol=1e-3, atol=1e-6)


def test_shipped_checkpoint_is_small_and_fits():
    assert CHECKPOINT.stat().st_size < 8_000_000
    load_network(CHECKPOINT)


@pytest.mark.parametrize("content", [b"", b"not a checkpoint", b"PK\x03\x04 truncated"])
def test_damaged_checkpoint_is_one_sentence(tmp_path, content):
    path = tmp_path / "w.pt"
    path.write_bytes(content)
    with pytest.raises(ModelError, match="damaged"):
        load_network(path)


def test_truncated_checkpoint_is_one_sentence(tmp_path):
    path = tmp_path / "w.pt"
    path.write_bytes(CHECKPOINT.read_bytes()[:100_000])
    with pytest.raises(ModelError, match="damaged"):
        load_network(path)


def test_checkpoint_of_another_network_is_one_sentence(tmp_path):
    torch.save({"weight": torch.zeros(3)}, tmp_path / "w.pt")
    with pytest.raises(ModelError, match="another network"):
        load_network(tmp_path / "w.pt")
    with pytest.raises(ModelError, match="does not hold"):
        convert_ade20k(build_mobilenet_deeplab(), tmp_path / "w.pt")


def test_missing_checkpoint_is_one_sentence(tmp_path):
    with pytest.raises(ModelError, match="no network weights"):
        load_network(tmp_path / "w.pt")


def test_ade20k_start_already_knows_rooms(shared):
    """Before any training, the converted weights must label walls, floors and chairs better than chance by far."""
    from semslam.loop.segmentation.decoding import decode, shrink
    from semslam.loop.segmentation.photos import list_names, read_photo

    folder = shared / "weights" / "deeplabv3plus_mnv2_ade20k32"
    network = build_mobilenet_deeplab()
    convert_ade20k(network, next(folder.glob("*.pt")))
    network.eval()
    right = total = 0
    for name in list_names(shared / "data" / "nyuv2", "val.txt")[::20]:
        photo = read_photo(shared / "data" / "nyuv2", name)
        pixels = torch.from_numpy(shrink(photo.color, (320, 240))[None]).permute(0, 3, 1, 2).float() / 127.5 - 1
        with torch.inference_mode():
            labels = decode(network(pixels)[0][0].numpy(), (640, 480)).labels
        known = np.isin(photo.labels, (1, 2, 4, 5, 6, 22))  # wall floor bed chair sofa ceiling
        right += int((labels == photo.labels)[known].sum())
        total += int(known.sum())
    assert right / total > 0.45
