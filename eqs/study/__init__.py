"""What a study found: tables, statistics, figures and a report. It reads tables, never tensors."""

from eqs.study.answer import answer
from eqs.study.console import print_eqs, print_study
from eqs.study.printed import printed_accuracy, printed_scores
from eqs.study.report import ReportContent, ReportFigure, render_report, write_report
from eqs.study.statistics import (
    TARGETS,
    Correlation,
    Target,
    correlate,
    correlations,
    write_correlations,
)
from eqs.study.tables import (
    REFERENCE,
    Drops,
    drops,
    eqs_table,
    read_table,
    scaled_score,
    simulated,
    study_table,
    summarise_eqs,
    summarise_study,
    write_table,
)

__all__ = [
    "REFERENCE",
    "TARGETS",
    "Correlation",
    "Drops",
    "ReportContent",
    "ReportFigure",
    "Target",
    "answer",
    "correlate",
    "correlations",
    "drops",
    "eqs_table",
    "print_eqs",
    "print_study",
    "printed_accuracy",
    "printed_scores",
    "read_table",
    "render_report",
    "scaled_score",
    "simulated",
    "study_table",
    "summarise_eqs",
    "summarise_study",
    "write_correlations",
    "write_report",
    "write_table",
]
