"""Simulate the events of a folder of images or a video."""

from eqs.commands import run

if __name__ == "__main__":
    run("simulate")
