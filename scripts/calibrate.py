"""Tune a simulator to real events by raising their EQS."""

from eqs.commands import run

if __name__ == "__main__":
    run("calibrate")
