"""Score a simulated event file against a real one."""

from eqs.commands import run

if __name__ == "__main__":
    run("score")
