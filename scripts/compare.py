"""Compare trainings: accuracy over wall time, and how their settings differ."""

from eqs.commands import run

if __name__ == "__main__":
    run("compare")
