"""Time the simulators, the score, reading for a training, or the detector against plain code."""

from eqs.commands import run

if __name__ == "__main__":
    run("benchmark")
