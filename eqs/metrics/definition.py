"""What exactly a score means: every choice of the metric, with a hash of them all."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Final, Literal, NamedTuple, get_args, get_origin, get_type_hints

from eqs.files import short_hash

# The activations of a stage that can be compared, in networks that do not name their own.
ACTIVATIONS = ("gate", "gate_logits", "hidden", "cell", "attention", "downsample")

# Choices on which the pooled features do not depend: a centre serves whatever these say.
BESIDE_FEATURES = (
    "tap", "features", "distance", "stages", "mask", "warmup_windows", "architecture",
)  # fmt: skip
# Choices in which readings may differ that share one pass of the judge.
OF_A_READING = ("tap", "features", "distance", "patch", "patch_size", "pooling", "mask")
# The headline until version 2, which stays beside it, and the paper's to the letter.
VERSION_1: Final[dict[str, Any]] = {
    "features": "centred",
    "distance": "cosine",
    "patch": "cells",
    "patch_size": 3,
}

# Choices that have one reading here. They are part of the hash, so that a later alternative
# cannot be mistaken for this one.
FIXED_RULES = {
    "version": "2",
    "aggregation": "mean over patches, stages with equal weights, windows, sequences",
    "agreement": "patches weigh by the squared lengths of both vectors together",
    "silence": "response to no events in the same window, the last of the warm-up from then on",
    "normalised": "each window to 35 events per pixel and second, then at most count_cutoff",
    "border": "weights of real cells alone, padded right and bottom",
    "smooth": "triangle over the patch and half of each neighbour",
    "start": "state zero, one per stream",
    "warmup": "first min(warmup_windows, n // 4) windows",
    "whitened": "covariance of real features, shrunk by 0.1 towards its mean variance",
    "zero": "both zero 1, one zero 0, eps 1e-8",
}


class Maps(NamedTuple):
    """Maps of an activation, pooled in one way."""

    tap: str
    patch: str
    patch_size: int
    pooling: str


@dataclass(frozen=True, kw_only=True)
class Definition:
    """Every choice that changes an Event Quality Score, except the judge.

    The judge, that is the backbone's weights and the centre of the real features, is named by its
    own sha256 beside the score.

    Convention: `warmup_windows` is an upper bound; a stream of n windows drops the first
    `min(warmup_windows, n // 4)`.

    Args:
        tap: which activation of each stage is compared: gate (the paper's formula), gate_logits,
            hidden, cell, attention or downsample; of another network than RVT a name of its own.
        features: compared as they are, `raw`; minus the judge's response to `silence`; `centred`,
            minus the mean real feature; or also `whitened`, so that real features vary alike in
            every direction.
        distance: `cosine`, each patch alike; or `agreement`, in which lengths count as well and a
            patch weighs by how much happens in it.
        stages: stages of the backbone, counted from 1.
        patch: `cells`, squares of so many cells, or `grid`, the map cut into so many by so many.
        patch_size: side of a patch in cells, or patches per side of the map.
        pooling: `box`, the mean of a patch's cells, or `smooth`, weights that fall off into the
            neighbouring patches.
        state: `carried` from window to window, or `reset` to zero before each.
        mask: `none`, or `active`: only patches in which either stream has events count.
        bins: time bins per window and polarity.
        window_us: length of a window in microseconds.
        count_cutoff: events per pixel and bin at which the histogram saturates.
        span: time the bins cover, the whole `window` or first to last of its `events`.
        counts: `raw`, or `normalised`: each window is scaled to one mean count.
        warmup_windows: most windows dropped while the state settles.
        architecture: name of the backbone with whatever changes its output besides weights.

    Raises:
        ValueError: a choice is unknown or out of range.

    Example:
        >>> Definition(tap="gate").hash == Definition(tap="hidden").hash
        False
    """

    tap: str = "hidden"
    features: Literal["raw", "silence", "centred", "whitened"] = "silence"
    distance: Literal["cosine", "agreement"] = "agreement"
    stages: tuple[int, ...] = (1, 2, 3)
    patch: Literal["cells", "grid"] = "cells"
    patch_size: int = 1
    pooling: Literal["box", "smooth"] = "box"
    state: Literal["carried", "reset"] = "carried"
    mask: Literal["none", "active"] = "none"
    bins: int = 10
    window_us: int = 50_000
    count_cutoff: int = 10
    span: Literal["window", "events"] = "window"
    counts: Literal["raw", "normalised"] = "raw"
    warmup_windows: int = 20
    architecture: str = "rvt-small"

    def __post_init__(self) -> None:
        """Reject what no score can be computed from."""
        if any(not isinstance(stage, int) for stage in self.stages):
            raise ValueError(
                f"Expected stages as whole numbers, got {self.stages}; set eqs.stages=[1,2,3]"
            )
        if not self.stages or list(self.stages) != sorted({*self.stages}) or min(self.stages) < 1:
            raise ValueError(
                f"Expected stages counted from 1 in rising order, got {self.stages}; set eqs.stages"
            )
        for name, known in kinds().items():
            if getattr(self, name) not in known:
                raise ValueError(
                    f"Expected {name} {' or '.join(known)}, got {getattr(self, name)!r}; "
                    f"set eqs.{name}"
                )
        for name in ("patch_size", "bins", "window_us", "count_cutoff", "warmup_windows"):
            value, least = getattr(self, name), int(name != "warmup_windows")
            if not isinstance(value, int) or value < least:
                raise ValueError(
                    f"Expected {name} to be a whole number of at least {least}, got {value!r}; "
                    f"set eqs.{name}"
                )

    @property
    def hash(self) -> str:
        """First 12 hex digits of the sha256 of all choices as canonical JSON."""
        choices = json.dumps({**asdict(self), **FIXED_RULES}, sort_keys=True)
        return hashlib.sha256(choices.encode()).hexdigest()[:12]

    @property
    def features_hash(self) -> str:
        """Eight hex digits of what pooled features depend on beside the network and its tap."""
        choices = asdict(self)
        return short_hash({k: value for k, value in choices.items() if k not in BESIDE_FEATURES})

    @property
    def column(self) -> str:
        """Name of the reading in a table, for instance `hidden_centred` or `gate_raw`."""
        return f"{self.tap}_{self.features}"

    @property
    def needs_centre(self) -> bool:
        """Whether it takes the mean of real features."""
        return self.features in ("centred", "whitened")

    @property
    def maps(self) -> Maps:
        """Which pooled maps it looks at."""
        return Maps(self.tap, self.patch, self.patch_size, self.pooling)

    @property
    def one_pass(self) -> Definition:
        """The same for all readings that share one pass of the judge."""
        plain = Definition()
        return replace(self, **{name: getattr(plain, name) for name in OF_A_READING})

    def warmup_of(self, windows: int) -> int:
        """Windows dropped at the start of a stream of `windows` windows."""
        return min(self.warmup_windows, windows // 4)


def kinds() -> dict[str, tuple[str, ...]]:
    """The values of each choice that is one of a few words.

    Example:
        >>> kinds()["state"]
        ('carried', 'reset')
    """
    hints = get_type_hints(Definition)
    return {name: get_args(hint) for name, hint in hints.items() if get_origin(hint) is Literal}


def choices() -> tuple[str, ...]:
    """Names of the choices that a user of a judge has, in the order of the definition.

    Example:
        >>> choices()[:2]
        ('tap', 'features')
    """
    return tuple(field.name for field in fields(Definition) if field.name != "architecture")
