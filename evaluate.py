"""Tabulate what was trained; with --eqs, also score the simulators and write the report."""

import sys

import hydra
from omegaconf import DictConfig

from eqs import pipelines


@hydra.main(version_base="1.3", config_path="configs", config_name="evaluate")
def main(cfg: DictConfig) -> None:
    """See configs/evaluate.yaml for what can be set."""
    pipelines.evaluate(cfg)


if __name__ == "__main__":
    # Hydra reads only key=value, so the flag is a spelling of one; it may stand anywhere.
    sys.argv = ["score=true" if argument == "--eqs" else argument for argument in sys.argv]
    main()
