"""Train a detector on one event stream and test it there and on the real one."""

from eqs.commands import run

if __name__ == "__main__":
    run("train")
