"""Event Quality Score: how real is simulated event-camera data, and does it matter?"""

__version__ = "0.1.0"
