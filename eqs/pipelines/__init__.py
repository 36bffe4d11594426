"""What a command does: configuration to objects to files."""

from eqs.pipelines.calibrate import calibrate
from eqs.pipelines.command import keys_explained
from eqs.pipelines.detections import detections_over
from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.prepare import prepare
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.runs import Run
from eqs.pipelines.score_files import score_files
from eqs.pipelines.simulate import simulate
from eqs.pipelines.train import train

register_resolvers()

__all__ = [
    "Run",
    "calibrate",
    "detections_over",
    "evaluate",
    "keys_explained",
    "prepare",
    "register_resolvers",
    "score_files",
    "simulate",
    "train",
]
