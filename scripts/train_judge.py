"""Train a judge on rendered scenes of many kinds."""

from eqs.commands import run

if __name__ == "__main__":
    run("train-judge")
