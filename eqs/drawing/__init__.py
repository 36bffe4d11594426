"""Pictures of events and of what is found in them: stills, films, maps, curves over time."""

from eqs.drawing.curves import event_rate, learning_curves, rate_curves, score_curve
from eqs.drawing.film import (
    event_picture,
    event_pictures,
    framed,
    histogram_picture,
    picture_times,
    with_boxes,
    write_film,
)
from eqs.drawing.pictures import Boxes, detection_panels, event_image, events_panels, score_maps
from eqs.drawing.style import save_figure

__all__ = [
    "Boxes",
    "detection_panels",
    "event_image",
    "event_picture",
    "event_pictures",
    "event_rate",
    "events_panels",
    "framed",
    "histogram_picture",
    "learning_curves",
    "picture_times",
    "rate_curves",
    "save_figure",
    "score_curve",
    "score_maps",
    "with_boxes",
    "write_film",
]
