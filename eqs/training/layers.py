"""How layers that look at a whole batch see the batches of all processes."""

from __future__ import annotations

from lightning.pytorch.plugins.layer_sync import LayerSync
from torch import nn

from eqs.models import SyncBatchNorm


class SynchronisedNorms(LayerSync):
    """Lets the trainer turn batch norms into synchronised ones, on CPU as on GPU."""

    def apply(self, model: nn.Module) -> nn.Module:
        """Replace the norms of a model."""
        return SyncBatchNorm.convert(model)

    def revert(self, model: nn.Module) -> nn.Module:
        """Nothing to do: in one process both norms compute the same."""
        return model
