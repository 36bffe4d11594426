"""Time simulators, score, detector, event files, or reading for a training, on this machine."""

from eqs.commands import run

if __name__ == "__main__":
    run("benchmark")
