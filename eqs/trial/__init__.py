"""The trial of scores: streams whose order is known, and how many pairs a score has in order."""

from eqs.trial.chains import Level, damage_chains, record, sensor_chains
from eqs.trial.challengers import Challengers, Means
from eqs.trial.order import floor_share, in_order, rank_agreement, shares_in_order, way_lost

__all__ = [
    "Challengers",
    "Level",
    "Means",
    "damage_chains",
    "floor_share",
    "in_order",
    "rank_agreement",
    "record",
    "sensor_chains",
    "shares_in_order",
    "way_lost",
]
