"""Clips that all simulator tests share."""

import numpy as np
import pytest


def random_walk(frames=20, height=16, width=16, seed=0):
    """Grey uint8 frames whose pixels wander, with jumps and rests, from black to white."""
    generator = np.random.default_rng(seed)
    steps = generator.normal(0, 25, (frames, height, width))
    steps *= generator.random((frames, height, width)) < 0.6
    walk = generator.uniform(0, 255, (height, width)) + np.cumsum(steps, axis=0)
    return np.clip(walk, 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def walk():
    """A random walk and its uneven times."""
    frames = random_walk()
    gaps = np.random.default_rng(1).integers(20_000, 60_000, len(frames))
    return frames, np.cumsum(gaps)
