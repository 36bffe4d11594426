"""What scores streams: a frozen network with its hash, its definition and its real centres."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self, cast

import torch
from torch import nn

from eqs.metrics.centre import Centre, feature_centres
from eqs.metrics.definition import VERSION_1, Definition, choices
from eqs.metrics.features import TappedBackbone, choices_for, require_taps
from eqs.metrics.judge_folder import RECORD, WEIGHTS, file_of, read_judge, write_judge
from eqs.metrics.network import (
    Network,
    OwnNetwork,
    RVTShape,
    trained_backbone,
    weights_sha256,
)
from eqs.metrics.reading import Reading
from eqs.metrics.windows import StreamOrHistograms
from eqs.models import RVTBackbone
from eqs.models.detector import cut_to

SHIPPED = Path(__file__).parents[1] / "judges"


def shipped() -> tuple[str, ...]:
    """Names of the judges that come with the package."""
    return tuple(sorted(path.parent.name for path in SHIPPED.glob(f"*/{RECORD}")))


def place_of(name: Path | str) -> Path:
    """Where the judge of that name lies: one of the package's, unless there is such a path."""
    path = Path(name)
    return SHIPPED / path if str(name) in shipped() and not path.exists() else path


@dataclass(frozen=True, kw_only=True, eq=False)
class Judge:
    """A frozen network and what its scores are measured against, the same for every candidate.

    On disk it is a folder: `judge.json` beside the weights and the centres that it names by their
    hashes. `train.py sim=real` writes one into the run's folder.

    Args:
        backbone: the network.
        definition: what its scores mean where nobody chooses otherwise: the headline.
        weights_sha256: hash of the network's named tensors; empty where it has none.
        centres: mean real features, one for each activation and way to pool, for readings that
            subtract them.
        network: what builds the network again; None for one that is only in memory.
        description: what it was trained on, in a phrase.

    Example:
        >>> judge = Judge.random(size="tiny")
        >>> judge.definition.features, judge.reading(tap="gate").name
        ('silence', 'gate_silence')
    """

    backbone: TappedBackbone
    definition: Definition = field(default_factory=Definition)
    weights_sha256: str = ""
    centres: tuple[Centre, ...] = ()
    network: Network | None = None
    description: str = "a network given in memory"

    @classmethod
    def of(cls, backbone: TappedBackbone, **chosen: Any) -> Self:  # noqa: ANN401
        """A judge around any network with `taps`.

        Args:
            backbone: the network.
            **chosen: choices of the headline, see `Definition`.
        """
        digest = weights_sha256(backbone) if isinstance(backbone, nn.Module) else ""
        named = {"architecture": type(backbone).__name__, **choices_for(backbone)}
        definition = Definition(**{**named, **chosen})
        return cls(backbone=backbone, definition=definition, weights_sha256=digest)

    @classmethod
    def random(cls, seed: int = 0, **shape: Any) -> Self:  # noqa: ANN401
        """The control: an RVT that learnt nothing; the same seed gives the same weights.

        Args:
            seed: seed of the weights.
            **shape: see `RVTShape`.
        """
        network = RVTShape(**shape)
        return cls._of(network.untrained(seed), network, "random weights, a control")

    @classmethod
    def built(cls, settings: Mapping[str, Any]) -> Self:
        """A judge around a network of your own, without centres.

        Args:
            settings: keyword arguments of a torch module that is a `TappedBackbone`, with the
                dotted name of its class as `_target_`. It loads its own weights; what it draws is
                always the same.

        Raises:
            ValueError: there is no such class, it does not take these, or it cannot judge.
        """
        network = OwnNetwork(settings=settings)
        return cls._of(network.build(), network, f"a network {network.architecture}")

    @classmethod
    def from_checkpoint(
        cls,
        path: Path | str,
        partition_split_32: int | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Self:
        """A judge without centres from a detector's checkpoint.

        Args:
            path: checkpoint of a detector trained on real events.
            partition_split_32: of an RVT as it was trained; None for what the checkpoint knows, or
                else 2.
            settings: what builds a detector of your own, see `built`; None for an RVT.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file holds no such detector, or an RVT of no known size or of another
                partition.
        """
        description = f"weights of {Path(path).name}"
        if settings is not None:
            own = OwnNetwork(settings=settings)
            return cls._of(own.trained(path), own, description)
        return cls._of(*trained_backbone(path, partition_split_32), description)

    @classmethod
    def shortened(cls, backbone: RVTBackbone, description: str) -> Self:
        """What scores need of a trained RVT: the stages that they look at, in half precision."""
        cut, size = cut_to(backbone, max(Definition.stages))
        shape = RVTShape(
            size=size, bins=cut.in_channels // 2, partition_split_32=cut.partition_split_32
        )
        return cls._of(cut, shape, description)

    @classmethod
    def _of(cls, backbone: nn.Module, network: Network, description: str) -> Self:
        shown = cast(TappedBackbone, backbone)
        judge = cls.of(shown, architecture=network.architecture)
        return replace(judge, network=network, description=description)

    @classmethod
    def load(cls, place: Path | str, partition_split_32: int | None = None) -> Self:
        """The judge of a folder or of a checkpoint, or the control for the word `random`.

        Weights that lie in a judge's folder are that judge.

        Args:
            place: name of one in the package, folder with `judge.json`, checkpoint of a
            detector, or `random`.
            partition_split_32: of a bare checkpoint, where it is not 2; a folder knows its own.

        Raises:
            FileNotFoundError: there is neither.
            ValueError: weights or centres are not those that the record names.
        """
        path = place_of(place)
        folder = path.parent if path.name == WEIGHTS else path
        if (folder / RECORD).is_file():
            judge = cls(**read_judge(folder))
            trained = judge.network.record().get("partition_split_32") if judge.network else None
            if partition_split_32 not in (None, trained):
                raise ValueError(
                    f"Expected the judge in {folder} with partition_split_32={trained}, as it was "
                    f"trained, got {partition_split_32}; leave eqs.partition_split_32 out"
                )
            return judge
        if str(place) == "random":
            return cls.random(partition_split_32=partition_split_32 or RVTShape.partition_split_32)
        if path.is_dir():
            raise FileNotFoundError(
                f"Expected {RECORD} in {path}, got a folder without; set eqs.judge to the folder "
                "of a finished `train.py sim=real`, or to a checkpoint"
            )
        return cls.from_checkpoint(path, partition_split_32)

    def save(self, folder: Path | str) -> None:
        """Write the folder that `load` reads; weights that lie there already are kept.

        Raises:
            ValueError: the network is only in memory, so nothing could build it again.
        """
        module = cast(nn.Module, self.backbone)
        parts = module, self._network(), self.definition, self.centres, self.description
        write_judge(Path(folder), *parts)

    def define(self, **chosen: Any) -> Definition:  # noqa: ANN401
        """The judge's definition with other choices.

        Raises:
            ValueError: there is no such choice, or not that value of it, or no such activation.
        """
        unknown = chosen.keys() - {*choices()}
        if unknown:
            raise ValueError(
                f"Expected choices among {', '.join(choices())}, got {', '.join(sorted(unknown))}; "
                "set one of these"
            )
        if chosen.get("bins", self.definition.bins) != self.definition.bins:
            raise ValueError(
                f"Expected {self.definition.bins} bins, as the judge was trained with, got "
                f"{chosen['bins']}; set eqs.bins or eqs.judge"
            )
        require_taps(self.backbone, [chosen.get("tap", self.definition.tap)])
        stages = tuple(chosen.get("stages", self.definition.stages))
        return replace(self.definition, **{**chosen, "stages": stages})

    def reading(self, **chosen: Any) -> Reading:  # noqa: ANN401
        """What is compared and how: the headline where nothing is chosen.

        Raises:
            ValueError: a choice is impossible, or it needs a centre that the judge lacks.
        """
        definition = self.define(**chosen)
        if not definition.needs_centre:
            return Reading(definition=definition)
        centre = self.centre_for(definition)
        if centre is None:
            raise ValueError(
                f"Expected a judge with a centre of the activation {definition.tap}, pooled and "
                f"binned as chosen, for {definition.features} features, got one without; set "
                "eqs.judge, or eqs.features=silence"
            )
        return Reading(definition=definition, centre=centre)

    def centre_for(self, definition: Definition) -> Centre | None:
        """The centre that belongs to a definition, if the judge has it."""
        for centre in self.centres:
            if centre.tap == definition.tap and centre.features_hash in (
                "",
                definition.features_hash,
            ):
                return centre
        return None

    def centred_on(
        self,
        recordings: Iterable[StreamOrHistograms],
        taps: Sequence[str] = ("hidden",),
        *,
        chunk_windows: int | None = None,
        content: str = "",
        **chosen: Any,  # noqa: ANN401
    ) -> Self:
        """The same judge with the mean features of real recordings, for readings with a centre.

        Args:
            recordings: real recordings, those the network was trained on.
            taps: activations to compute a centre for.
            chunk_windows: windows per pass; chosen from the sensor size if None.
            content: hash of what the recordings hold, which the centres keep.
            **chosen: how features are pooled and binned, where not as in `VERSION_1` and as the
                judge bins.

        Raises:
            ValueError: there is no recording, or a feature is not finite.
        """
        made = feature_centres(
            self.backbone,
            recordings,
            taps=taps,
            definition=self.define(**{**VERSION_1, **chosen}),
            chunk_windows=chunk_windows,
            device=self.device,
        )
        noted = (replace(centre, recordings=content) for centre in made.values())
        new = {file_of(centre): centre for centre in noted}
        kept = {file_of(centre): centre for centre in self.centres}
        return replace(self, centres=tuple({**kept, **new}.values()))

    def untrained(self, seed: int = 0) -> Judge:
        """The control of this judge: its network with random weights and no centre.

        Raises:
            ValueError: the network is only in memory, so nothing could build it again.
        """
        network = self._network()
        control = Judge._of(network.untrained(seed), network, "random weights, a control")
        return replace(control.to(self.device), definition=self.definition)

    def _network(self) -> Network:
        if self.network is None:
            raise ValueError(
                "Expected a network that can be built anew, got a "
                f"{self.definition.architecture} that is only in memory; use Judge.built"
            )
        return self.network

    @property
    def device(self) -> torch.device:
        """Where the network lives."""
        if isinstance(self.backbone, nn.Module):
            for parameter in self.backbone.parameters():
                return parameter.device
        return torch.device("cpu")

    def to(self, device: torch.device | str) -> Self:
        """Move the network; the judge itself is returned."""
        if isinstance(self.backbone, nn.Module):
            self.backbone.to(device)
        return self
