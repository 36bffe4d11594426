"""What every clip passes through: bands of pixels, event keys and their order, the readout."""
