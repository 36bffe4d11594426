"""Timings of what has to be fast, each against what it is compared with."""
