"""Fetch the weights of a network that makes frames in between, for interpolation=rife."""

from eqs.commands import run

if __name__ == "__main__":
    run("fetch-interpolator")
