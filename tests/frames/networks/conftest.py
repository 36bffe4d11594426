"""Files of networks."""

import warnings

import pytest
import torch


@pytest.fixture
def saved(tmp_path):
    """Saves what PyTorch saves."""

    def save(content, name="network.pt", **options):
        torch.save(content, tmp_path / name, **options)
        return tmp_path / name

    return save


@pytest.fixture
def scripted(tmp_path):
    """Saves a network as TorchScript, whose makers have to hear that it is deprecated."""

    def save(network, name="script.pt"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            torch.jit.script(network).save(str(tmp_path / name))
        return tmp_path / name

    return save
