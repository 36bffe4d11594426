"""Tabulate finished runs; on request, score the simulators and write the study's results."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig
from rich.console import Console

from eqs.data import Dataset, EventSource, MixedEvents
from eqs.drawing import save_figure
from eqs.metrics.grid import fewest_windows
from eqs.names import BASELINE, MARK
from eqs.pipelines.build import dataset, event_source
from eqs.pipelines.command import explained
from eqs.pipelines.comparable import comparable_runs
from eqs.pipelines.judge import require_judge
from eqs.pipelines.publish import Findings, publish
from eqs.pipelines.reverse import reverse_precision
from eqs.pipelines.runs import Run, finished_runs
from eqs.pipelines.sanity import sanity
from eqs.pipelines.score import score_recordings
from eqs.pipelines.scoring import find_scoring
from eqs.pipelines.sensors import OTHERS, named, results_folder, sensor_of
from eqs.pipelines.timing import phase_times
from eqs.study import (
    eqs_table,
    has_mixing,
    mixing_curve,
    print_eqs,
    print_sensors,
    print_study,
    sensors_table,
    study_table,
    write_table,
)

log = logging.getLogger(__name__)


@explained
def evaluate(cfg: DictConfig) -> None:
    """Print the mAPs of all finished runs and, with `score`, do the rest of the study.

    With `sanity` the score itself is tested instead, which needs a judge and nothing else.

    Raises:
        ValueError: there is neither a finished run nor anything to score.
    """
    console = Console()
    results = results_folder(cfg)
    if cfg.sanity:
        sanity(cfg, results, console)
        return
    found = list(finished_runs(Path(cfg.paths.runs) / cfg.data.name))
    if cfg.score:
        require_judge(cfg)  # before a data set is generated
        for simulator in cfg.simulators.values():
            event_source(simulator, cfg)
    runs = comparable_runs(cfg, found) if found else []
    if cfg.score:
        score(cfg, runs, results, console)
    elif runs:
        study = study_table(study_rows(runs))
        # Beside `study.csv`, which holds scores as well.
        write_table(study, results / "accuracy.csv")
        print_study(study, console)
        if has_mixing(study):
            drawn = save_figure(mixing_curve(study), results / "figures", "mixing")
            console.print(f"[bold]mixing[/bold]: {drawn}")
        show_sensors(cfg, console)
    else:
        raise ValueError(
            f"Expected a finished run on {cfg.data.name} with this recipe and these data, got "
            "none; type `python train.py sim=esim` first, or repeat the overrides of the training"
        )


def study_rows(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """One row per run, as `study.csv` wants it."""
    names = run_names(runs)
    rows = []
    for run in runs:
        result, own, real = run.result, run.result.own, run.result.real
        rows.append(
            {
                "simulator": result.simulator,
                "system": names[result.system],
                "trained_on": result.trained_on,
                "seed": result.seed,
                "map_sim": own.map,
                "map50_sim": own.map_50,
                "map_real": real.map,
                "map50_real": real.map_50,
                **{f"ap_sim_{name}": value for name, value in own.map_per_class.items()},
                **{f"ap_real_{name}": value for name, value in real.map_per_class.items()},
                "protocol": result.protocol["hash"],
                "recipe": result.recipe,
                "data": result.data,
                "real_share": result.real_share,
                "beside": result.beside,
                "before": result.before,
                "caveat": result.caveat,
                "sensor": result.sensor,
            }
        )
    return rows


def short_names(
    systems: Sequence[tuple[str, str]],
    settings: Mapping[str, str] | None = None,
    marked: Collection[str] = (),
) -> dict[str, str]:
    """What to call each system: its simulator's name, with its setting or label where several are.

    Args:
        systems: name of the simulator and label of the stream.
        settings: what a simulator sees of frames, by label.
        marked: labels of those that are no simulators like others, whose names end in a mark.
    """
    named = [(label, name) for name, label in set(systems)]
    said = {label: f"{name} {(settings or {}).get(label, '')}".strip() for label, name in named}
    by_name, by_setting = Counter(name for _, name in named), Counter(said.values())
    names = {}
    for name, label in systems:
        shortest = said[label] if by_setting[said[label]] == 1 else label
        names[label] = (name if by_name[name] == 1 else shortest) + MARK * (label in marked)
    return names


def run_names(runs: Sequence[Run]) -> dict[str, str]:
    """What to call the system of each run."""
    results = [run.result for run in runs]
    return short_names(
        [(each.simulator, each.system) for each in results],
        {each.system: each.setting for each in results},
        {each.system for each in results if each.caveat},
    )


def score(cfg: DictConfig, runs: Sequence[Run], results: Path, console: Console) -> None:
    """Score all systems, write every table and figure and the report."""
    times = phase_times(cfg)
    data = dataset(cfg)
    recordings = data.scored_recordings()
    data.make_events(recordings)
    systems = scored_systems(cfg, runs)
    scoring = find_scoring(cfg, data)  # first: without one, simulating would be in vain
    for source in systems.values():
        source.prepare(recordings)
    with times.measure("score"):
        scores = score_recordings(scoring, recordings, systems, data.crop_rows)
    rows = [
        {
            "simulator": systems[row["system"]].name,
            "caveat": systems[row["system"]].caveat,
            **row,
        }
        for row in scores.rows
    ]
    table = eqs_table(rows)
    with times.measure("reverse mAP"):
        study = with_reverse(study_rows(runs), runs, data, systems)
    names = run_names(runs)
    found = Findings(
        recordings=recordings,
        judge=scoring.judge,
        headline=scoring.headline,
        systems=systems,
        runs={names[run.result.system]: run for run in runs if run.result.plain},
        scores=scores,
        eqs=table,
        study=study_table(study, table) if runs else None,
    )
    print_eqs(table, console, fewest_windows(scoring.headline.definition.warmup_windows))
    if found.study is not None:
        print_study(found.study, console)
    with times.measure("report"):
        publish(cfg, results, data, found, times.read())
    console.print(
        f"[bold]judge[/bold]: {found.judge.description} ({found.judge.weights_sha256[:12]})"
    )
    sensor = sensor_of(data)
    if sensor is not None:
        console.print(f"[bold]sensor[/bold]: {sensor.words}")
    console.print(f"[bold]report[/bold]: {results / 'report.html'}")
    show_sensors(cfg, console)
    phases = times.read()
    # Trainings may have run side by side, so the sum is work, not waiting.
    for phase, seconds in {**phases, "sum of phases": sum(phases.values())}.items():
        console.print(f"  {phase:<24}{seconds:8.1f} s")


def show_sensors(cfg: DictConfig, console: Console) -> None:
    """Join and print what was found with every sensor, where there are several."""
    folder = Path(cfg.paths.results) / cfg.data.name
    others = {place.name: place for place in sorted((folder / OTHERS).glob("*-*"))}
    if not others:
        return
    own = instantiate(cfg.data.generator.sensor).definition_hash()
    table = sensors_table({named(own).label: folder, **others})
    write_table(table, folder / "sensors.csv")
    print_sensors(table, console)
    console.print(f"[bold]sensors[/bold]: {folder / 'sensors.csv'}")


def with_reverse(
    rows: list[dict[str, Any]],
    runs: Sequence[Run],
    data: Dataset,
    systems: Mapping[str, EventSource],
) -> list[dict[str, Any]]:
    """Rows of `study.csv` with the mAP that the real-trained detector of the same seed reaches."""
    real = {run.result.seed: run for run in runs if run.result.simulator == "real"}
    found = {seed: reverse_precision(run, data, systems) for seed, run in real.items()}
    return [
        {**row, f"{BASELINE}reverse_map": found.get(row["seed"], {}).get(row["system"], math.nan)}
        for row in rows
    ]


def scored_systems(cfg: DictConfig, runs: Sequence[Run]) -> Mapping[str, EventSource]:
    """Configured simulators and those of the finished runs, by the name used in the tables."""
    configured = [event_source(simulator, cfg) for simulator in cfg.simulators.values()]
    if any(isinstance(source, MixedEvents) for source in configured):
        raise ValueError("Expected simulators to score, got a mix; take sim=mix out of simulators")
    trained = [event_source(run.config().sim, cfg) for run in runs if run.result.plain]
    sources = {s.label: s for s in [*configured, *trained] if s.name != "real"}
    names = short_names(
        [(source.name, label) for label, source in sources.items()],
        {label: source.setting for label, source in sources.items()},
        {label for label, source in sources.items() if source.caveat},
    )
    return {names[label]: source for label, source in sources.items()}
