"""The ray tracer, Mitsuba 3: loaded when a street is traced, and told which of its kinds to be."""

from __future__ import annotations

from typing import Any, Final

from eqs.extras import needed

VARIANT: Final = "scalar_spectral"  # by name, never by what is there: the LLVM ones may abort


def engine() -> Any:  # noqa: ANN401 - a module without types
    """The module `mitsuba`, set to trace spectra on the processor.

    Raises:
        ValueError: it is not installed.
    """
    with needed("traced", "to trace rays"):
        import mitsuba
    if mitsuba.variant() != VARIANT:
        mitsuba.set_variant(VARIANT)
    return mitsuba
