"""Convert an event file of any kind to HDF5 in the layout of DSEC."""

from eqs.commands import run

if __name__ == "__main__":
    run("convert")
