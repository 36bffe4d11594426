"""What a study found: tables, statistics, figures and a report. It reads tables, never tensors."""

from eqs.study.answer import answer
from eqs.study.calibration import calibration_table, print_calibration
from eqs.study.captions import FIGURE_TEXTS, report_figure
from eqs.study.console import print_eqs, print_sanity, print_study
from eqs.study.correlation import (
    TARGETS,
    Correlation,
    Target,
    correlate,
    correlations,
    write_correlations,
)
from eqs.study.figures import accuracy_bars, score_against_accuracy, sequence_dots
from eqs.study.mixing import has_mixing, mixing_curve, mixing_points
from eqs.study.printed import printed_accuracy, printed_scores
from eqs.study.report import ReportContent, ReportFigure, render_report, write_report
from eqs.study.sanity import order_faults, sanity_figure, sanity_table, severity_correlations
from eqs.study.sensors import print_sensors, sensors_table
from eqs.study.tables import (
    Drops,
    drops,
    eqs_table,
    scaled_score,
    simulated,
    study_table,
    summarise_eqs,
    summarise_study,
)
from eqs.study.written import read_table, write_table

__all__ = [
    "FIGURE_TEXTS",
    "TARGETS",
    "Correlation",
    "Drops",
    "ReportContent",
    "ReportFigure",
    "Target",
    "accuracy_bars",
    "answer",
    "calibration_table",
    "correlate",
    "correlations",
    "drops",
    "eqs_table",
    "has_mixing",
    "mixing_curve",
    "mixing_points",
    "order_faults",
    "print_calibration",
    "print_eqs",
    "print_sanity",
    "print_sensors",
    "print_study",
    "printed_accuracy",
    "printed_scores",
    "read_table",
    "render_report",
    "report_figure",
    "sanity_figure",
    "sanity_table",
    "scaled_score",
    "score_against_accuracy",
    "sensors_table",
    "sequence_dots",
    "severity_correlations",
    "simulated",
    "study_table",
    "summarise_eqs",
    "summarise_study",
    "write_correlations",
    "write_report",
    "write_table",
]
