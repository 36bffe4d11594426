"""Events of several kinds to train on together: a share of the recordings of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from eqs.data.recording import Recording
from eqs.data.simulated import EventSource
from eqs.files import short_hash


@dataclass(frozen=True, kw_only=True)
class Mix:
    """What is mixed, as a configuration says it.

    Args:
        streams: by a name of one's own, `events`, a simulator or the recorded or given events, and
            `share`, that of the training recordings which are seen through them; 0 leaves them out.
        evaluated_on: the stream that validation and the test on "own" events see, whatever its
            share; the first that has a share if None.
        seed: chooses the recordings.

    Raises:
        ValueError: a share is none, no stream has one, or `evaluated_on` is not among them.
    """

    name: ClassVar[str] = "mix"
    streams: Mapping[str, Mapping[str, Any]]
    evaluated_on: str | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the shares and the names."""
        for name, stream in self.streams.items():
            share, key = stream.get("share"), f"sim.streams.{name}.share"
            number = isinstance(share, int | float) and not isinstance(share, bool)
            if not (number and 0 <= share <= 1):  # type: ignore[operator]
                raise ValueError(f"Expected a share in [0, 1], got {share!r}; set {key}")
            if stream.get("events") is None:
                raise ValueError(
                    f"Expected events of the stream {name}, got none; add "
                    f"+sim@sim.streams.{name}.events=NAME"
                )
        if not any(stream["share"] for stream in self.streams.values()):
            keys = ", ".join(f"sim.streams.{name}.share" for name in self.streams)
            raise ValueError(f"Expected a stream with a share, got none; set {keys}")
        if self.evaluated_on is not None and self.evaluated_on not in self.streams:
            raise ValueError(
                f"Expected one of the streams {', '.join(self.streams)}, got "
                f"{self.evaluated_on!r}; set sim.evaluated_on"
            )


@dataclass(frozen=True, kw_only=True)
class MixedEvents:
    """An event source for training alone: whole recordings, each seen through a stream or several.

    Convention: shares concern the training split. Of every other recording, `path` names the events
    of one stream.

    Args:
        sources: the event source of each stream, by its name.
        shares: the share of each stream, in [0, 1].
        evaluated_on: name of the stream of all other splits.
        seed: chooses the recordings.
    """

    sources: Mapping[str, EventSource]
    shares: Mapping[str, float]
    evaluated_on: str
    seed: int

    @property
    def parts(self) -> dict[str, float]:
        """The share of each simulator or `real`; settings of one simulator go by their labels."""
        mixed = {name: self.sources[name] for name, share in self.shares.items() if share}
        settings = Counter(source.name for source in mixed.values())
        return {
            source.name if settings[source.name] == 1 else source.label: self.shares[name]
            for name, source in mixed.items()
        }

    @property
    def name(self) -> str:
        """What is mixed, with shares in per cent, as in `mix_esim100_real10`."""
        shown = [
            f"{self.sources[name].name}{100 * share:g}"
            for name, share in self.shares.items()
            if share
        ]
        return "_".join(["mix", *shown])

    @property
    def caveat(self) -> str:
        """A mix has no score, and is no point of a correlation anyway."""
        return ""

    @property
    def setting(self) -> str:
        """Its name says what it is made of."""
        return ""

    @property
    def label(self) -> str:
        """Name and a hash of streams and shares, and of the seed where it chooses recordings."""
        mixed = {name: share for name, share in self.shares.items() if share}
        parts = [[name, self.sources[name].label, share] for name, share in mixed.items()]
        chosen = any(share < 1 for share in mixed.values())
        evaluated = self.evaluation.label
        return f"{self.name}-{short_hash([parts, evaluated, self.seed if chosen else None])}"

    @property
    def evaluation(self) -> EventSource:
        """The events that validation and the test on "own" events see."""
        return self.sources[self.evaluated_on]

    def prepare(self, recordings: Sequence[Recording]) -> None:
        """Make the files of every stream that is seen."""
        for name, source in self.sources.items():
            if self.shares[name] or name == self.evaluated_on:
                source.prepare(recordings)

    def path(self, recording: Recording) -> Path:
        """The recording's events in the stream that is not trained on but evaluated on."""
        return self.evaluation.path(recording)

    def training_files(self, recordings: Sequence[Recording]) -> list[tuple[Recording, Path]]:
        """The chosen recordings of each stream with their events, stream after stream."""
        return [
            (recording, source.path(recording))
            for name, source in self.sources.items()
            for recording in chosen(recordings, self.shares[name], self.seed, name)
        ]


def chosen(
    recordings: Sequence[Recording], share: float, seed: int, stream: str
) -> list[Recording]:
    """Whole recordings drawn by seed, in their order; those of a share are among a larger one's.

    Args:
        recordings: what there is.
        share: in [0, 1]; above zero it is one recording at least.
        seed: together with the recording's name it decides, whatever else there is.
        stream: streams of different names draw apart.
    """
    count = max(1, round(share * len(recordings))) if share else 0
    ranks = [short_hash([seed, stream, recording.name]) for recording in recordings]
    drawn = sorted(range(len(recordings)), key=ranks.__getitem__)[:count]
    return [recordings[place] for place in sorted(drawn)]
