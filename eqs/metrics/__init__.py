"""Scores: the Event Quality Score of two streams, and the mean average precision of detections."""

from eqs.metrics.accuracy import Accuracy
from eqs.metrics.battery import EXPECTED_ORDER, GRADED, anchors, singles
from eqs.metrics.centre import Centre, feature_centres
from eqs.metrics.definition import ACTIVATIONS, Definition
from eqs.metrics.detection import MeanAveragePrecision
from eqs.metrics.eqs import EventQualityScore
from eqs.metrics.features import TappedBackbone, pooled_features
from eqs.metrics.judge import Judge
from eqs.metrics.network import RVTShape, weights_sha256
from eqs.metrics.pooling import pool_grid, pool_patches, smooth_grid, smooth_patches
from eqs.metrics.reading import Reading
from eqs.metrics.scoring import StreamScore, score_group, score_streams, score_tensors
from eqs.metrics.similarity import combine_maps, mean_over_stages, patch_cosine, whitening_matrix
from eqs.metrics.windows import group_chunks, histogram_chunks, normalised_counts, window_starts

__all__ = [
    "ACTIVATIONS",
    "EXPECTED_ORDER",
    "GRADED",
    "Accuracy",
    "Centre",
    "Definition",
    "EventQualityScore",
    "Judge",
    "MeanAveragePrecision",
    "RVTShape",
    "Reading",
    "StreamScore",
    "TappedBackbone",
    "anchors",
    "combine_maps",
    "feature_centres",
    "group_chunks",
    "histogram_chunks",
    "mean_over_stages",
    "normalised_counts",
    "patch_cosine",
    "pool_grid",
    "pool_patches",
    "pooled_features",
    "score_group",
    "score_streams",
    "score_tensors",
    "singles",
    "smooth_grid",
    "smooth_patches",
    "weights_sha256",
    "whitening_matrix",
    "window_starts",
]
