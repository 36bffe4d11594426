"""Simulators whose events a network expects: EventGAN, and networks of one's own."""

from eqs.simulators.learned.eventgan import FOLDS, EventGAN, Learning
from eqs.simulators.learned.volume_network import VolumeNetwork

__all__ = ["FOLDS", "EventGAN", "Learning", "VolumeNetwork"]
