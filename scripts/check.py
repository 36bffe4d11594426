"""See whether a data set can be used as it lies there."""

from eqs.commands import run

if __name__ == "__main__":
    run("check")
