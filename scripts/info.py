"""Say what an event file of any kind holds."""

from eqs.commands import run

if __name__ == "__main__":
    run("info")
