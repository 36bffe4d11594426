"""What a judge makes of nothing: its response to a stream without events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch

from eqs.metrics.definition import Definition, Maps
from eqs.metrics.features import Pooled, TappedBackbone, pooled_features
from eqs.metrics.windows import chunk_length


class Silence:
    """A judge's response to silence, window by window; it depends on nothing but the judge.

    Convention: from the last window of the warm-up on it is that of this window, so that a long
    recording costs no longer a silence. A judge that drifts on gives a blank stream more than 0.

    Args:
        backbone: the judge's network.
        device: where it lives.
    """

    def __init__(self, backbone: TappedBackbone, device: torch.device | str = "cpu") -> None:
        """Nothing is computed before it is asked for, and everything once."""
        self.backbone, self.device = backbone, device
        self._known: dict[tuple[int, int, Definition], Pooled] = {}

    def responses(
        self,
        definitions: Sequence[Definition],
        size: tuple[int, int],
        first: int,
        windows: int,
    ) -> Pooled:
        """The responses in a run of windows.

        Args:
            definitions: what is read, sharing one pass.
            size: rows and columns of the sensor.
            first: number of the run's first window, counted from the start of the stream.
            windows: length of the run.

        Returns:
            As `pooled_features` gives it for a single stream.
        """
        settled = 0 if definitions[0].state == "reset" else definitions[0].warmup_windows
        key = (*size, definitions[0].one_pass)
        known = self._known.setdefault(key, {})
        missing = [each for each in definitions if each.maps not in known]
        if missing:
            known |= self._run(missing, size, settled + 1)
        index = torch.arange(first, first + windows, device=self.device).clamp_max(settled)
        return {
            maps: [stage.index_select(0, index.to(stage.device)) for stage in known[maps]]
            for maps in {each.maps for each in definitions}
        }

    def _run(
        self, definitions: Sequence[Definition], size: tuple[int, int], windows: int
    ) -> Pooled:
        nothing = torch.zeros(windows, 1, 2 * definitions[0].bins, *size)
        plain = [replace(each, mask="none") for each in definitions]
        parts = list(
            pooled_features(
                self.backbone,
                nothing.split(chunk_length(1, *size)),
                definitions=plain,
                device=self.device,
            )
        )
        maps: list[Maps] = [*parts[0]]
        return {
            each: [torch.cat(stages) for stages in zip(*(p[each] for p in parts), strict=True)]
            for each in maps
        }
