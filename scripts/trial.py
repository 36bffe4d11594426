"""Put scores on trial: streams of known order, and how many pairs each has in order."""

from eqs.commands import run

if __name__ == "__main__":
    run("trial")
