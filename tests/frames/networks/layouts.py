"""Contents of files as networks are published, with weights that say what comes out."""

import torch

from eqs.frames.networks.rife import Rife
from eqs.frames.networks.super_slomo import FLOWS, FRAMES, UNet


def zeros_of(make):
    """Weights of a network, all zero; each takes a single number in a file."""
    with torch.device("meta"):
        network = make()
    return {
        name: torch.zeros(1).expand(tensor.shape) for name, tensor in network.state_dict().items()
    }


def super_slomo(planes=1, bias=(0.0, 0.0, 0.0, 0.0), logit=0.0):
    """A checkpoint whose flows are everywhere the same; negative ones are reduced to a tenth."""
    flows = zeros_of(lambda: UNet(2 * planes, 4))
    frames = zeros_of(lambda: UNet(4 * planes + 8, 5))
    flows["conv3.bias"] = torch.tensor(bias)
    frames["conv3.bias"] = torch.tensor([0.0, 0.0, 0.0, 0.0, logit])
    return {FLOWS: flows, FRAMES: frames}


def rife(**blocks):
    """Weights whose blocks say the same everywhere: thirteen planes each, by the block's name."""
    weights = zeros_of(Rife)
    for name, planes in blocks.items():
        weights[f"{name}.lastconv.0.bias"] = torch.tensor(planes).repeat_interleave(4)
    return weights
