"""Published networks that make frames between frames, from the files their authors gave.

Importing this room imports torch, so whoever may do without a network imports it when one is asked
for.
"""

from eqs.frames.networks.fetching import Published, downloaded, fetch
from eqs.frames.networks.loading import network_of
from eqs.frames.networks.planes import Between

__all__ = ["Between", "Published", "downloaded", "fetch", "network_of"]
