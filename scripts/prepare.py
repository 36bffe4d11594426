"""Generate the data set and simulate all its streams, before several trainings share them."""

import hydra
from omegaconf import DictConfig

from eqs import pipelines


@hydra.main(version_base="1.3", config_path="../configs", config_name="evaluate")
def main(cfg: DictConfig) -> None:
    """See configs/evaluate.yaml for what can be set."""
    pipelines.prepare(cfg)


if __name__ == "__main__":
    with pipelines.keys_explained():
        main()
