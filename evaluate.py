"""Tabulate what was trained; with --eqs, score the simulators; with --sanity, test the score."""

from eqs.commands import run

if __name__ == "__main__":
    run("evaluate")
