"""Score a simulated event file against a real one."""

import sys

import hydra
from omegaconf import DictConfig

from eqs import pipelines


@hydra.main(version_base="1.3", config_path="../configs", config_name="score")
def main(cfg: DictConfig) -> None:
    """See configs/score.yaml for what can be set."""
    pipelines.score_files(cfg)


if __name__ == "__main__":
    # Hydra reads only key=value: the first two plain arguments are the files.
    plain = [k for k, a in enumerate(sys.argv) if k and "=" not in a and not a.startswith("-")]
    for key, place in zip(("simulated", "real"), plain, strict=False):
        sys.argv[place] = f"{key}={sys.argv[place]}"
    with pipelines.keys_explained():
        main()
