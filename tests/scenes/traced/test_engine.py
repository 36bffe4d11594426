"""The ray tracer is asked for when it is needed, and not before."""

import subprocess
import sys

import pytest

from eqs.scenes.traced import TracedStreet
from eqs.scenes.traced.engine import VARIANT, engine


def test_who_lacks_the_tracer_is_told_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    said = r"Expected the package mitsuba to trace rays, got none; type pip install '.*\[traced\]'"
    with pytest.raises(ValueError, match=said):
        TracedStreet(height=2, width=2, seed=(1,))


def test_naming_the_street_loads_no_tracer():
    code = "import sys, eqs.scenes.traced; sys.exit('mitsuba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_variant_is_chosen_by_name():
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    assert engine().variant() == VARIANT
