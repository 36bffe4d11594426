"""A process counts on the cores that it may use and need not share."""

import pytest

from eqs import processors


@pytest.mark.parametrize(("processes", "cores"), [(1, 6), (2, 3), (4, 1), (9, 1)])
def test_side_by_side_each_has_its_part(monkeypatch, processes, cores):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: range(6), raising=False)
    monkeypatch.setattr(processors, "_share", 1)
    processors.share_cores(processes)
    assert processors.available_cores() == cores
