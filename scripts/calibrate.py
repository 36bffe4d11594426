"""Tune a simulator to real events by raising their EQS."""

import hydra
from omegaconf import DictConfig

from eqs import pipelines


@hydra.main(version_base="1.3", config_path="../configs", config_name="calibrate")
def main(cfg: DictConfig) -> None:
    """See configs/calibrate.yaml for what can be set."""
    pipelines.calibrate(cfg)


if __name__ == "__main__":
    with pipelines.keys_explained():
        main()
