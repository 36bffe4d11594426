"""Learn the networks of a simulator, which whatever needs them otherwise does itself."""

from eqs.commands import run

if __name__ == "__main__":
    run("train-simulator")
