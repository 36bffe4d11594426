"""Time simulators, score, detector, event files, interpolation, or reading for a training."""

from eqs.commands import run

if __name__ == "__main__":
    run("benchmark")
