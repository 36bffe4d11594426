"""One way to read features, and the comparison that it asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from eqs.metrics.centre import Centre
from eqs.metrics.definition import Definition, Maps
from eqs.metrics.features import ACTIVE
from eqs.metrics.similarity import moved, patch_agreement, patch_cosine


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One way to read the same features: a definition with the centre it needs.

    Args:
        definition: every choice of the score.
        centre: mean real feature; needed where the features are centred or whitened.

    Raises:
        ValueError: the centre is missing, not asked for, of another tap or of features made
            otherwise, or without the covariances that whiten.
    """

    definition: Definition
    centre: Centre | None = None

    def __post_init__(self) -> None:
        """Check that definition and centre belong together."""
        if self.definition.needs_centre != (self.centre is not None):
            wanted, got = ("a", "none") if self.centre is None else ("no", "one")
            raise ValueError(
                f"Expected {wanted} centre for {self.definition.features} features, got {got}; "
                "set eqs.judge or eqs.features"
            )
        if self.centre is not None and self.centre.tap != self.definition.tap:
            raise ValueError(
                f"Expected a centre of tap {self.definition.tap}, got one of {self.centre.tap}; "
                "set eqs.judge or eqs.tap"
            )
        if self.centre is not None and self.centre.features_hash not in (
            "",
            self.definition.features_hash,
        ):
            raise ValueError(
                "Expected a centre of features pooled and binned as these are, got one of others; "
                "set eqs.judge, or the keys from eqs.patch to eqs.state as when it was computed"
            )
        whitened = self.definition.features == "whitened"
        if whitened and self.centre is not None and not self.centre.covariances:
            raise ValueError(
                "Expected a centre with covariances for whitened features, got means alone; "
                "compute the centre again or set eqs.features=centred"
            )

    @property
    def name(self) -> str:
        """Name of the column in a table, for instance `hidden_centred`."""
        return self.definition.column


class Comparison:
    """Compares pooled features as one reading says."""

    def __init__(self, reading: Reading) -> None:
        """Look up the centres and the whitenings of the reading's stages."""
        self.definition = reading.definition
        self.nothing: list[Tensor | None] = [None] * len(self.definition.stages)
        self.centres = self.whitenings = self.nothing
        if reading.centre is not None:
            self.centres = [*reading.centre.for_stages(self.definition.stages)]
            if self.definition.features == "whitened":
                self.whitenings = [*reading.centre.whitening(self.definition.stages)]

    def similarities(
        self, pooled: Mapping[Maps, Sequence[Tensor]], silence: Sequence[Tensor] | None = None
    ) -> list[tuple[Tensor, Tensor]]:
        """By stage each patch's similarity, and how much it weighs.

        Args:
            pooled: by maps and stage (windows, streams, channels, rows, columns), the reference
                first.
            silence: by stage the response to no events in the same windows, (windows, 1, channels,
                rows, columns); needed by definitions that subtract it.

        Returns:
            Both of shape (windows, candidates, rows, columns).
        """
        chosen = self.definition
        maps, found = pooled[chosen.maps], []
        if chosen.features == "silence" and silence is not None:
            maps = [stage - each for stage, each in zip(maps, silence, strict=True)]
        masks = pooled.get(chosen.maps._replace(tap=ACTIVE), self.nothing)
        if chosen.mask == "none":
            masks = self.nothing
        stages = zip(maps, masks, self.centres, self.whitenings, strict=True)
        for stage, active, centre, whitening in stages:
            if not torch.isfinite(stage).all():
                raise ValueError(
                    "Expected finite features, got NaN or infinity; set eqs.judge to a sound one"
                )
            similarity, weight = self._compare(stage[:, 1:], stage[:, :1], centre, whitening)
            if active is not None:
                weight = weight * (active[:, 1:, 0] | active[:, :1, 0])
            found.append((similarity, weight))
        return found

    def _compare(
        self, a: Tensor, b: Tensor, centre: Tensor | None, whitening: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        if self.definition.distance == "agreement":
            return patch_agreement(moved(a, centre, whitening), moved(b, centre, whitening))
        cosine = patch_cosine(a, b, centre, whitening).double()
        return cosine, torch.ones_like(cosine)


def mean_over_patches(similarity: Tensor, weight: Tensor) -> Tensor:
    """Weighted mean of the patches; NaN where none counts."""
    return (similarity * weight).sum(dim=(-2, -1)) / weight.sum(dim=(-2, -1))
