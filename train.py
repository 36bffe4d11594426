"""Train a detector on one event stream and test it there and on the real one."""

import hydra
from omegaconf import DictConfig

from eqs import pipelines


@hydra.main(version_base="1.3", config_path="configs", config_name="train")
def main(cfg: DictConfig) -> None:
    """See configs/train.yaml for what can be set."""
    pipelines.train(cfg)


if __name__ == "__main__":
    with pipelines.keys_explained():
        main()
