"""Names that stand in tables, figures and configurations alike."""

REFERENCE = "real"
"""The system without a simulator: the recorded events themselves."""

BASELINE = "baseline_"
"""What the column of a baseline begins with."""

MARK = "†"
"""Ends the name of a system that is no simulator like others, for a reason that notes give."""
