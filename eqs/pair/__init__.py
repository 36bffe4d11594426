"""One simulated stream beside one real one: what differs, what it looks like, a page to read."""

from eqs.pair.diagnosis import Diagnosis, Finding, diagnose
from eqs.pair.nearest import FAMILIES, Nearest, Profile, damaged, nearest
from eqs.pair.page import PageContent, write_page
from eqs.pair.pictures import PageWindows, event_uri, map_uri, shown_windows

__all__ = [
    "FAMILIES",
    "Diagnosis",
    "Finding",
    "Nearest",
    "PageContent",
    "PageWindows",
    "Profile",
    "damaged",
    "diagnose",
    "event_uri",
    "map_uri",
    "nearest",
    "shown_windows",
    "write_page",
]
