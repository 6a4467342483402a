"""Averages the weights of several networks that were trained from the same start.

Such networks lie in one basin of the loss, and their mean is often better than each of them (Wortsman et al.,
Model soups, ICML 2022); it costs nothing at run time.
"""

from collections.abc import Sequence
from pathlib import Path

import torch

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.segmentation.decoding import input_size
from semslam.loop.segmentation.network.checkpoint import load_network, save_weights
from semslam.loop.segmentation.network.export import write_calibrated
from semslam.loop.segmentation.network.narrowing import narrow_decoder, plain_views
from semslam.loop.segmentation.network.network import DeepLab
from semslam.loop.segmentation.photos import read_photos


def average(directory: Path, weights: Sequence[Path], config: Config, out: Path) -> Path:
    """Write the mean of several networks: ``weights.pt`` (float16) and ``weights.onnx`` (int8).

    Args:
        directory: in the NYUv2 layout; photos of its training part calibrate the int8 graph.
        weights: checkpoints of ``semslam train-segmenter``.
        config: ``segmentation`` gives the size that int8 is calibrated at; to ``training.decoder_channels`` wider
            decoders are narrowed first.
        out: folder to write to.

    Returns:
        The path of the float16 weights.

    Raises:
        DatasetError: the folder is not in the NYUv2 layout.
        ModelError: a checkpoint is missing, damaged or of another network.
        ConfigError: the input size does not fit the network.
    """
    size, photos = input_size(config.segmentation), read_photos(directory, "train.txt")
    networks = [load_network(path) for path in weights]
    if config.training.decoder_channels is not None:
        views = plain_views(photos, size)
        networks = [narrow_decoder(network, config.training.decoder_channels, views) for network in networks]
    network = mean_network(networks)
    save_weights(network, out / "weights.pt")
    write_calibrated(network, out / "weights.onnx", photos, size)
    return out / "weights.pt"


@torch.no_grad()
def mean_network(networks: Sequence[DeepLab]) -> DeepLab:
    """The first network with each weight replaced by the mean over all networks.

    Raises:
        ModelError: their decoders are not of one width.
    """
    total = networks[0]
    for count, other in enumerate(networks[1:], start=2):
        if other.decoder_channels != total.decoder_channels:
            widths = sorted({network.decoder_channels for network in networks})
            raise ModelError(f"Networks with decoders of {widths} channels have no mean; narrow them to one width.")
        addends = other.state_dict()
        for name, value in total.state_dict().items():
            if value.is_floating_point():
                value.lerp_(addends[name], 1.0 / count)
    return total
