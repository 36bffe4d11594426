"""Show an event file as a GIF, an MP4 or a strip of stills."""

from eqs.commands import run

if __name__ == "__main__":
    run("view")
