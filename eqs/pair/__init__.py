"""One simulated stream beside one real one: what differs, what it looks like, a page to read."""

from eqs.pair.diagnosis import Diagnosis, Finding, diagnose
from eqs.pair.nearest import DAMAGES, Nearest, damaged, nearest
from eqs.pair.page import PageWindows, write_page

__all__ = [
    "DAMAGES",
    "Diagnosis",
    "Finding",
    "Nearest",
    "PageWindows",
    "damaged",
    "diagnose",
    "nearest",
    "write_page",
]
