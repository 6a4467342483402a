"""A narrower decoder: nothing is lost while channels repeat one another, and a width that cannot be had is refused."""

import pytest
import torch

from semslam.errors import ModelError
from semslam.loop.segmentation.network.checkpoint import load_network
from semslam.loop.segmentation.network.narrowing import narrow_decoder
from semslam.loop.segmentation.network.network import build_mobilenet_deeplab
from semslam.loop.segmentation.shipped import CHECKPOINT


@pytest.fixture
def images():
    return torch.rand(2, 3, 48, 64, generator=torch.Generator().manual_seed(0)) * 2 - 1


@torch.no_grad()
def repeated(network, channels):
    """Make the decoder's channels from ``channels`` on copies of its first ones."""
    state = network.state_dict()
    copies = torch.arange(network.decoder_channels) % channels
    for layer in ("decoder.0.1.conv.weight", "decoder.1.0.conv.weight", "decoder.1.1.conv.weight"):
        state[layer].copy_(state[layer][copies])
    return network


def test_channels_that_repeat_others_are_not_missed(images):
    torch.manual_seed(0)
    network = repeated(build_mobilenet_deeplab(decoder_channels=24), 16).eval()
    narrow = narrow_decoder(network, 16, images).eval()
    assert narrow.decoder_channels == 16
    with torch.inference_mode():
        before, after = network(images)[0], narrow(images)[0]
    assert torch.allclose(before, after, atol=2e-3 * before.abs().max().item())


def test_fewer_channels_say_nearly_the_same(images):
    network = load_network(CHECKPOINT).eval()
    with torch.inference_mode():
        before = network(images)[0]
        losses = [((narrow_decoder(network, n, images).eval()(images)[0] - before) ** 2).mean() for n in (128, 64, 8)]
    assert losses[0] < losses[1] < losses[2] < before.var()


def test_a_width_it_has_changes_nothing(images):
    network = build_mobilenet_deeplab(decoder_channels=32)
    assert narrow_decoder(network, 32, images) is network


def test_a_decoder_cannot_be_widened(images):
    with pytest.raises(ModelError, match="32 channels"):
        narrow_decoder(build_mobilenet_deeplab(decoder_channels=32), 33, images)
