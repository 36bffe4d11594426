"""Generate the data set and simulate all its streams, before several trainings share them."""

from eqs.commands import run

if __name__ == "__main__":
    run("prepare")
