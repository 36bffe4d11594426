"""Simulate the events of a folder of images or a video."""

import hydra
from omegaconf import DictConfig

from eqs import pipelines


@hydra.main(version_base="1.3", config_path="../configs", config_name="simulate")
def main(cfg: DictConfig) -> None:
    """See configs/simulate.yaml for what can be set."""
    pipelines.simulate(cfg)


if __name__ == "__main__":
    with pipelines.keys_explained():
        main()
