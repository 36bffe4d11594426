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
    names = iter(("simulated", "real"))
    plain = [a for a in sys.argv[1:] if "=" not in a and not a.startswith("-")][:2]
    named = {argument: f"{name}={argument}" for name, argument in zip(names, plain, strict=False)}
    sys.argv[1:] = [named.get(argument, argument) for argument in sys.argv[1:]]
    main()
