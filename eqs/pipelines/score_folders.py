"""EQS of folders of event files, recording by recording, to one table and one page."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from rich.console import Console

from eqs.content import content_hashes
from eqs.data.places import EVENT_SUFFIXES, EVENTS
from eqs.events import EventReader
from eqs.events.formats import open_events
from eqs.events.loaded import LoadedEvents
from eqs.extras import needed
from eqs.files import read_json, short_hash, write_json
from eqs.frames import by_name
from eqs.metrics.grid import fewest_windows
from eqs.metrics.windows import common_grid
from eqs.pipelines.following import Following
from eqs.pipelines.score import Scene, Scores, score_scene
from eqs.pipelines.scoring import Scoring

log = logging.getLogger(__name__)
SUFFIXES = (*EVENT_SUFFIXES, ".txt", ".tsv", ".zip")
LISTED = 5
VERSION = 1  # raised whenever equal files begin to score otherwise


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Which files are scored against which.

    Args:
        real: the real file of each recording.
        systems: by the simulator's name, its file of each recording that it has.
    """

    real: Mapping[str, Path]
    systems: Mapping[str, Mapping[str, Path]]

    @property
    def recordings(self) -> list[str]:
        """The recordings that at least one simulator has."""
        return [name for name in self.real if any(name in each for each in self.systems.values())]

    def streams(self, recording: str) -> dict[str, Path]:
        """The files of a recording, by simulator."""
        return {
            name: files[recording] for name, files in self.systems.items() if recording in files
        }


def event_files(folder: Path) -> dict[str, Path]:
    """The event file of each recording in a folder.

    A recording is a file, named as it is, or a folder with `events/left/events.h5` or with one
    event file of any kind.

    Raises:
        ValueError: there are two files of one name.
    """
    found: dict[str, Path] = {}
    for path in by_name(folder.iterdir()):
        if path.name.startswith("."):
            continue
        file = path if path.is_file() and path.suffix.lower() in SUFFIXES else _inside(path)
        if file is None:
            continue
        name = path.stem if path.is_file() else path.name
        if name in found:
            raise ValueError(
                f"Expected one event file of {name} in {folder}, got {found[name].name} and "
                f"{path.name}; keep one"
            )
        found[name] = file
    return found


def _inside(folder: Path) -> Path | None:
    """The events of a recording's folder."""
    if not folder.is_dir():
        return None
    if (folder / EVENTS).is_file():
        return folder / EVENTS
    files = [path for path in folder.iterdir() if path.suffix.lower() in EVENT_SUFFIXES]
    return files[0] if len(files) == 1 and files[0].is_file() else None


def find_pairs(simulated: Path, real: Path) -> Pairs:
    """Pair the files of two folders by the recordings' names.

    The simulated folder holds the recordings of one simulator, or a folder of them for each of
    several. What has no partner is named.

    Raises:
        ValueError: nothing can be paired.
    """
    recorded = event_files(real)
    systems = {simulated.resolve().name: event_files(simulated)}
    if not recorded.keys() & next(iter(systems.values())).keys():
        folders = by_name(path for path in simulated.iterdir() if path.is_dir())
        systems = {folder.name: event_files(folder) for folder in folders}
    systems = {name: files for name, files in systems.items() if recorded.keys() & files.keys()}
    if not systems:
        raise ValueError(
            f"Expected event files of equal names in {simulated} and {real}, or in folders of "
            f"{simulated}, got {some(event_files(simulated))} and {some(recorded)}; name each file "
            "as its recording"
        )
    for name, files in systems.items():
        if alone := files.keys() - recorded.keys():
            log.warning("%s: no real file of %s, left out", name, some(sorted(alone)))
        if missing := recorded.keys() - files.keys():
            log.warning("%s has no file of %s", name, some(sorted(missing)))
    return Pairs(real=recorded, systems=systems)


def some(names: Sequence[str] | Mapping[str, Any]) -> str:
    """A few names, and how many more there are.

    Example:
        >>> some([]), some("abcdefgh")
        ('none', 'a, b, c, d, e and 3 more')
    """
    shown = list(names)
    more = f" and {len(shown) - LISTED} more" if len(shown) > LISTED else ""
    return (", ".join(shown[:LISTED]) or "none") + more


def score_folders(cfg: DictConfig, scoring: Scoring) -> None:
    """Score every pair, print the tables, and write them and the report to `cfg.out`.

    Pairs that were scored before are taken from there while their files are what they were.

    Raises:
        ValueError: nothing can be paired, or the streams of a recording do not fit.
    """
    out, pairs = Path(cfg.out), find_pairs(Path(cfg.simulated), Path(cfg.real))
    names = pairs.recordings
    scores, follow = Scores(), Following(len(names))
    for index, name in enumerate(names):
        other = names[(index + 1) % len(names)] if len(names) > 1 else None
        follow.recording(name)
        with follow:
            rows, anchored = _kept_or_scored(cfg, scoring, pairs, name, other, follow)
        scores.rows += rows
        scores.anchors += anchored
    publish(out, scores, scoring, {"simulated": str(cfg.simulated), "real": str(cfg.real)})


def _kept_or_scored(
    cfg: DictConfig,
    scoring: Scoring,
    pairs: Pairs,
    name: str,
    other: str | None,
    follow: Following,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    files = [pairs.real[name], *pairs.streams(name).values()]
    lender = [] if other is None else [pairs.real[other]]
    limits = [cfg.height, cfg.width, cfg.rows, cfg.start_us, cfg.stop_us]
    readings = [asdict(reading.definition) for reading in scoring.readings]
    centres = [None if each.centre is None else each.centre.sha256 for each in scoring.readings]
    judge = scoring.judge.weights_sha256
    content = content_hashes([*files, *lender])
    key = short_hash(
        [VERSION, judge, readings, centres, limits, content, list(pairs.streams(name)), other]
    )
    record = Path(cfg.out) / "recordings" / f"{name}.json"
    if record.is_file() and (kept := read_json(record)).get("key") == key:
        return kept["rows"], kept["anchors"]
    try:
        scores = scored(cfg, scoring, pairs, name, other, follow)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    write_json(record, {"key": key, "rows": scores.rows, "anchors": scores.anchors})
    return scores.rows, scores.anchors


def scored(
    cfg: DictConfig,
    scoring: Scoring,
    pairs: Pairs,
    name: str,
    other: str | None,
    follow: Following,
) -> Scores:
    """The scores of one recording; another one of its sensor lends the chance level."""
    size, scores = (cfg.height, cfg.width, cfg.rows), Scores()
    window_us = scoring.headline.definition.window_us
    with ExitStack() as stack:

        def opened(path: Path) -> EventReader | LoadedEvents:
            events = open_events(path, *size)
            stack.callback(events.__exit__, None, None, None)
            return events

        real = opened(pairs.real[name])
        streams = {system: opened(path) for system, path in pairs.streams(name).items()}
        lender = None if other is None else opened(pairs.real[other])
        if lender is not None and (lender.height, lender.width) != (real.height, real.width):
            lender = None
        grid = common_grid([real, *streams.values()], window_us, cfg.start_us, cfg.stop_us)
        scene = Scene(name=name, grid=grid)
        score_scene(scoring, scene, real, streams, lender, scores, follow)
    return scores


def publish(out: Path, scores: Scores, scoring: Scoring, folders: Mapping[str, str]) -> None:
    """Print and write the tables, and the report where its packages are there."""
    with needed("report", "for the tables and the page of folders"):
        from eqs.pipelines.publish import anchor_table, hashes
        from eqs.study import (
            ReportContent,
            eqs_table,
            print_eqs,
            report_figure,
            sequence_dots,
            write_report,
            write_table,
        )
    table = eqs_table([{"simulator": row["system"], **row} for row in scores.rows])
    fewest = fewest_windows(scoring.headline.definition.warmup_windows)
    console = Console()
    print_eqs(table, console, fewest)
    write_table(table, out / "eqs.csv")
    anchors = anchor_table(scores.anchors, f"eqs_{scoring.headline.name}")
    write_table(anchors, out / "anchors.csv")
    named = hashes(scoring.judge, scoring.headline, None)
    means = table.groupby("system")["eqs"].mean()
    write_json(
        out / "score.json",
        {**folders, "eqs": means.to_dict(), "definition": scoring.headline.definition.hash,
         "weights_sha256": scoring.judge.weights_sha256},
    )  # fmt: skip
    dots = report_figure(sequence_dots(table), out / "figures", "scores_by_sequence")
    content = ReportContent(
        data_name=Path(folders["real"]).resolve().name,
        data_is_rendered=False,
        eqs=table,
        anchors=anchors,
        figures={"scores_by_sequence": dots},
        hashes=named,
        judge=scoring.judge.description,
        fewest_windows=fewest,
    )
    console.print(f"[bold]report[/bold]: {write_report(out, content)}")
