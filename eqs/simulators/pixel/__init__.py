"""What the pixels of several models are made of: light, thresholds, crossings, noise, draws."""
