"""Render a street as frames that every simulator reads."""

from eqs.commands import run

if __name__ == "__main__":
    run("render")
