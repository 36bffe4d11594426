"""Tables as files: written whole, nothing lost that an earlier command wrote."""

from __future__ import annotations

import logging
from datetime import datetime
from pathlib import Path

import pandas as pd

from eqs.files import write_text
from eqs.study.tables import COUNT_COLUMNS, TEXT_COLUMNS, TIME_COLUMNS

log = logging.getLogger(__name__)
# What tells one row of a table from another.
ROW_NAMES = ("system", "sequence", "seed", "corruption", "severity", "anchor", "definition")


def write_table(table: pd.DataFrame, path: Path | str) -> Path:
    """Write a CSV that appears under its name only when it is complete.

    One that is there and holds columns or rows that the new one lacks is kept beside it.
    """
    path = Path(path)
    if path.is_file() and _loses(read_table(path), table):
        changed = datetime.fromtimestamp(path.stat().st_mtime)
        kept = path.with_name(f"{path.stem}-{changed:%Y%m%d-%H%M%S}{path.suffix}")
        path.replace(kept)
        log.info("%s held other rows or columns; it is kept as %s", path, kept.name)
    return write_text(table.to_csv(index=False), path)


def _loses(old: pd.DataFrame, new: pd.DataFrame) -> bool:
    """Whether a column, or a row by what names it, is only in the old table."""
    if {*old.columns} - {*new.columns}:
        return True
    names = [name for name in ROW_NAMES if name in old.columns]
    rows = [{*map(tuple, t[names].astype(str).to_numpy().tolist())} for t in (old, new)]
    return bool(rows[0] - rows[1])


def read_table(path: Path | str) -> pd.DataFrame:
    """Read a CSV of the study; names and hashes stay text, even where they look like numbers.

    Raises:
        FileNotFoundError: there is no such file.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(
            f"Expected a table {path.name} in {path.parent.name}/, found none; "
            "run evaluate.py first"
        )
    header = pd.read_csv(path, nrows=0).columns
    text = {name: str for name in header if name in TEXT_COLUMNS or name.endswith("_hash")}
    table = pd.read_csv(path, dtype=text)
    whole = (*TIME_COLUMNS, *COUNT_COLUMNS)
    return table.astype({name: "Int64" for name in whole if name in table})
