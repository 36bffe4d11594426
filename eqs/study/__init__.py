"""What a study found: tables, statistics, figures and a report. It reads tables, never tensors."""

from eqs.study.answer import answer
from eqs.study.calibration import calibration_table, print_calibration
from eqs.study.console import print_eqs, print_sanity, print_study
from eqs.study.correlation import (
    TARGETS,
    Correlation,
    Target,
    correlate,
    correlations,
    write_correlations,
)
from eqs.study.figures import (
    accuracy_bars,
    event_rate,
    learning_curves,
    rate_curves,
    score_against_accuracy,
    score_curve,
    sequence_dots,
)
from eqs.study.film import (
    event_picture,
    event_pictures,
    histogram_picture,
    with_boxes,
    write_film,
)
from eqs.study.pictures import Boxes, detection_panels, event_image, events_panels, score_maps
from eqs.study.printed import printed_accuracy, printed_scores
from eqs.study.report import ReportContent, ReportFigure, render_report, write_report
from eqs.study.sanity import order_faults, sanity_figure, sanity_table, severity_correlations
from eqs.study.style import FIGURE_TEXTS, report_figure, save_figure
from eqs.study.tables import (
    BASELINE,
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
    "BASELINE",
    "FIGURE_TEXTS",
    "REFERENCE",
    "TARGETS",
    "Boxes",
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
    "detection_panels",
    "drops",
    "eqs_table",
    "event_image",
    "event_picture",
    "event_pictures",
    "event_rate",
    "events_panels",
    "histogram_picture",
    "learning_curves",
    "order_faults",
    "print_calibration",
    "print_eqs",
    "print_sanity",
    "print_study",
    "printed_accuracy",
    "printed_scores",
    "rate_curves",
    "read_table",
    "render_report",
    "report_figure",
    "sanity_figure",
    "sanity_table",
    "save_figure",
    "scaled_score",
    "score_against_accuracy",
    "score_curve",
    "score_maps",
    "sequence_dots",
    "severity_correlations",
    "simulated",
    "study_table",
    "summarise_eqs",
    "summarise_study",
    "with_boxes",
    "write_correlations",
    "write_film",
    "write_report",
    "write_table",
]
