"""Tabulate what was trained; with --eqs, score the simulators; with --sanity, test the score."""

import sys

import hydra
from omegaconf import DictConfig

from eqs import pipelines

FLAGS = {"--eqs": "score=true", "--sanity": "sanity=true"}


@hydra.main(version_base="1.3", config_path="configs", config_name="evaluate")
def main(cfg: DictConfig) -> None:
    """See configs/evaluate.yaml for what can be set."""
    pipelines.evaluate(cfg)


if __name__ == "__main__":
    # Hydra reads only key=value, so a flag is a spelling of one; it may stand anywhere.
    sys.argv = [FLAGS.get(argument, argument) for argument in sys.argv]
    with pipelines.keys_explained():
        main()
