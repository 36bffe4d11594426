"""Film what a trained detector finds."""

from eqs.commands import run

if __name__ == "__main__":
    run("watch")
