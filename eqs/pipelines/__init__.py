"""What a command does: configuration to objects to files."""

from eqs.pipelines.evaluate import evaluate
from eqs.pipelines.prepare import prepare
from eqs.pipelines.resolvers import register_resolvers
from eqs.pipelines.train import train

register_resolvers()

__all__ = ["evaluate", "prepare", "register_resolvers", "train"]
