"""Values that configuration files derive rather than state."""

from __future__ import annotations

from omegaconf import OmegaConf

from eqs.processors import available_cores

# Each holds two batches ready; those of DSEC take a quarter of a gigabyte of shared memory.
MOST_WORKERS = 4


def precision(device: str) -> str:
    """Fastest safe number type of a device: "cpu", "gpu", or "auto" for what is there.

    bfloat16 autocast pays on processors that multiply in it and costs time on the others.
    """
    import torch  # only where the value is asked for, so that a mistyped command ends at once

    if device == "gpu" or (device == "auto" and torch.cuda.is_available()):
        return (
            "bf16-mixed"
            if torch.cuda.is_available() and torch.cuda.is_bf16_supported()
            else "16-mixed"
        )
    return "bf16-mixed" if torch.cpu.get_capabilities().get("avx512_bf16") else "32-true"


def workers() -> int:
    """Processes that should read beside a training.

    A GPU must not wait for one process that decompresses and bins; without one, readers would take
    the cores from the training.
    """
    import torch

    return min(MOST_WORKERS, available_cores()) if torch.cuda.is_available() else 0


def register_resolvers() -> None:
    """Make the resolvers known to OmegaConf; may be called again."""
    OmegaConf.register_new_resolver("precision", precision, replace=True)
    OmegaConf.register_new_resolver("workers", workers, replace=True)
    OmegaConf.register_new_resolver("length", len, replace=True)
    OmegaConf.register_new_resolver("multiply", lambda a, b: a * b, replace=True)
