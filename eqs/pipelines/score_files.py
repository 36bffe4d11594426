"""EQS of one event file against another, with anchors, a map and a curve."""

from __future__ import annotations

import csv
import logging
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from rich.console import Console

from eqs.events.bag import is_bag_folder
from eqs.extras import DISTRIBUTION
from eqs.files import complete_file, read_json, write_json
from eqs.metrics import StreamScore
from eqs.metrics.grid import fewest_windows
from eqs.pair import PageContent, write_page
from eqs.pipelines.command import explained
from eqs.pipelines.pair import Pair, compare
from eqs.pipelines.pair_lines import LEVELS, lines, rates, show
from eqs.pipelines.score_folders import score_folders
from eqs.pipelines.scoring import Scoring, find_scoring

log = logging.getLogger(__name__)

PAGE = "score.html"
FEW_WINDOWS = (
    "Few windows count (%d): a score of fewer than %d says little, with a warm-up cut short; give "
    "longer files"
)
UNKNOWN_SPAN = (
    "%s does not say from when to when its camera was watching, so the extent of the real file is "
    "scored; if the frames cover less, a study scores less: set start_us and stop_us to theirs"
)


@explained
def score_files(cfg: DictConfig) -> None:
    """Score `cfg.simulated` against `cfg.real`, print it, and write map and curve to `cfg.out`.

    Two folders are scored recording by recording, see `score_folders`.

    Raises:
        FileNotFoundError: a file is missing.
        ValueError: there is no judge, the streams share no whole window or no sensor size, or the
            folder holds files of these names that this command did not write.
    """
    out = Path(cfg.out)
    refuse_others(out)
    paths = [Path(path) for path in (cfg.simulated, cfg.real)]
    folders = [path.is_dir() and not is_bag_folder(path) for path in paths]
    if any(folders) and not all(folders):
        raise ValueError(
            f"Expected two files or two folders, got one of each: {cfg.simulated} and {cfg.real}; "
            "give two of a kind"
        )
    scoring = find_scoring(cfg, None)
    if all(folders):
        score_folders(cfg, scoring)
        return
    pair = compare(cfg, scoring)
    result, window_us = pair.scores[scoring.headline.name], pair.grid.window_us
    files = {"simulated": str(cfg.simulated), "real": str(cfg.real)}
    write_json(out / "score.json", files | record(pair, scoring))
    write_curve(out / "curve.csv", result, pair.grid.start_us, window_us)
    write_pair_page(out / PAGE, files, pair, scoring)
    show(pair, scoring, Console())
    log.info("page: %s", out / PAGE)
    fewest = fewest_windows(scoring.headline.definition.warmup_windows)
    if result.n_windows < fewest:
        log.warning(FEW_WINDOWS, result.n_windows, fewest)
    if pair.watched_us is None and (cfg.start_us is None or cfg.stop_us is None):
        log.warning(UNKNOWN_SPAN, cfg.simulated)
    ceiling = pair.anchors["ceiling"][scoring.headline.name]
    if find_spec("matplotlib") is None:
        log.info("no figures: they take pip install '%s[report]'", DISTRIBUTION)
    else:
        draw(out, result, window_us=window_us, ceiling=ceiling, size=pair.size)


def record(pair: Pair, scoring: Scoring) -> dict[str, Any]:
    """What `score.json` says of a pair."""
    result = pair.scores[scoring.headline.name]
    return {
        "eqs": result.score,
        "readings": {name: score.score for name, score in pair.scores.items()},
        "by_stage": list(result.by_stage),
        "anchors": pair.anchors,
        "reading": scoring.headline.name,
        **{name: pair.anchors[name][scoring.headline.name] for name in LEVELS},
        "chance_is": pair.chance,
        "nearest": [each._asdict() for each in pair.nearest],
        "nearest_us": pair.nearest_us,
        "nearest_eqs": pair.nearest_score if pair.nearest else None,
        "diagnosis": [
            {name: None if value != value else value for name, value in each._asdict().items()}
            for each in pair.diagnosis.findings
        ],
        "span_us": [pair.grid.start_us, pair.grid.stop_us],
        "windows": result.n_windows,
        "share": pair.grid.share,
        "simulated_span_us": None if pair.watched_us is None else list(pair.watched_us),
        "sensor": list(pair.size),
        "events": pair.events,
        "rates": rates(pair),
        "definition": scoring.headline.definition.hash,
        "weights_sha256": scoring.judge.weights_sha256,
    }


def write_curve(path: Path, score: StreamScore, start_us: int, window_us: int) -> None:
    """Write the score of every window and whether it counts; the file appears when complete."""
    with complete_file(path) as partial, partial.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(("stop_us", "eqs", "counts"))
        for number, value in enumerate(score.curve.tolist()):
            stop_us = start_us + (number + 1) * window_us
            rows.writerow((stop_us, value, number >= score.warmup))


def draw(
    out: Path, score: StreamScore, *, window_us: int, ceiling: float, size: tuple[int, int]
) -> None:
    """Draw where and when the streams differ."""
    from eqs.drawing import save_figure, score_curve, score_maps

    maps = {"simulated": score.map}
    drawn = score_maps(None, maps, patch_px=score.patch_px, height=size[0], width=size[1])
    save_figure(drawn, out, "map")
    curve = score_curve(score.curve, warmup=score.warmup, window_us=window_us, ceiling=ceiling)
    save_figure(curve, out, "curve")


def write_pair_page(path: Path, files: Mapping[str, str], pair: Pair, scoring: Scoring) -> None:
    """Write the page with both streams side by side."""
    headline = scoring.headline.name
    result = pair.scores[headline]
    names = [Path(files[each]).name for each in ("simulated", "real")]
    content = PageContent(
        title=f"{names[0]} beside {names[1]}: {result.score:.3f}",
        lines=lines(pair, scoring),
        reading=headline,
        curve=result.curve,
        warmup=result.warmup,
        start_us=pair.grid.start_us,
        window_us=pair.grid.window_us,
        levels={name: pair.anchors[name][headline] for name in LEVELS},
        windows=pair.windows,
        diagnosis=pair.diagnosis,
        nearest=pair.nearest,
        size=pair.size,
    )
    write_page(path, content)


def refuse_others(out: Path) -> None:
    """Let nobody lose files that are called as this command's are.

    Raises:
        ValueError: there are some, and no record of this command beside them.
    """
    names = (
        "score.json", "curve.csv", "map.png", "map.svg", "curve.png", "curve.svg", "eqs.csv",
        "anchors.csv", "report.html", PAGE,
    )  # fmt: skip
    there = [name for name in names if (out / name).exists()]
    record = out / "score.json"
    ours = record.is_file() and {"eqs", "definition"} <= read_json(record).keys()
    if there and not ours:
        raise ValueError(
            f"Expected a folder of earlier scores or none at {out}, got {', '.join(there)} of "
            "something else; set out"
        )
