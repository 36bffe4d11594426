"""A judge on disk: `judge.json` beside weights and centres, which it names by their hashes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import nn

from eqs.files import complete_file, read_json, write_json
from eqs.metrics.centre import Centre
from eqs.metrics.definition import Definition
from eqs.metrics.network import Network, network_of, weights_sha256

RECORD, WEIGHTS = "judge.json", "weights.ckpt"


def read_judge(folder: Path) -> dict[str, Any]:
    """The parts of the judge in a folder, by the names of its fields.

    Raises:
        ValueError: the record is none of ours, or weights or centres are not those that it names.
    """
    record = read_json(folder / RECORD)
    try:
        network = network_of(record["network"])
        stages = tuple(record["definition"].pop("stages"))
        definition = Definition(**record["definition"], stages=stages)
        files, description = record["centres"], record["description"]
        digest, weights = record["weights_sha256"], folder / record["weights"]
    except (KeyError, TypeError) as error:
        raise ValueError(
            f"Expected a judge written by this package in {folder}, got a {RECORD} that lacks or "
            f"adds {error}; delete that file and type the command again"
        ) from error
    backbone = network.trained(weights)
    centres = {name: Centre.load(folder / name) for name in files}
    changed = [name for name, centre in centres.items() if centre.sha256 != files[name]]
    if weights_sha256(backbone) != digest:
        changed.insert(0, weights.name)
    if changed:
        raise ValueError(
            f"Expected the files of the judge in {folder} to match their hashes, got others in "
            f"{', '.join(changed)}; set eqs.judge to another, or delete {RECORD}"
        )
    return {
        "backbone": backbone,
        "definition": definition,
        "weights_sha256": digest,
        "centres": tuple(centres.values()),
        "network": network,
        "description": description,
    }


def write_judge(
    folder: Path,
    backbone: nn.Module,
    network: Network,
    definition: Definition,
    centres: Sequence[Centre],
    description: str,
) -> None:
    """Write what `read_judge` reads; weights that lie there already are kept."""
    digest = weights_sha256(backbone)
    if not _holds(folder / WEIGHTS, digest, network):
        with complete_file(folder / WEIGHTS) as partial:
            torch.save(network.entries(backbone), partial)
    for centre in centres:
        centre.save(folder / file_of(centre))
    write_json(
        folder / RECORD,
        {
            "description": description,
            "network": network.record(),
            "definition": asdict(definition),
            "weights": WEIGHTS,
            "weights_sha256": digest,
            "centres": {file_of(centre): centre.sha256 for centre in centres},
        },
    )


def file_of(centre: Centre) -> str:
    """Name of a centre's file: one for each activation and way to pool."""
    return "-".join(filter(None, ("centre", centre.tap, centre.features_hash))) + ".npz"


def _holds(weights: Path, digest: str, network: Network) -> bool:
    if not weights.is_file():
        return False
    return weights_sha256(network.trained(weights)) == digest
