"""Networks built from plain settings, those of a configuration or of a file."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from torch import nn

TARGET = "_target_"


def class_of(settings: Mapping[str, Any], key: str = "model") -> type[nn.Module]:
    """The class that settings name.

    Settings come from files too, maybe those of others. So nothing is called that is not the class
    of a torch module, and it must be installed here already.

    Args:
        settings: keyword arguments, with the dotted name of the class as `_target_`.
        key: configuration key to name in errors.

    Raises:
        ValueError: there is no such class, or it is not that of a torch module.
    """
    target = str(settings.get(TARGET))
    module, _, name = target.rpartition(".")
    try:
        found = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(
            f"Expected a class that can be imported as {target}, got: {error}; set {key}.{TARGET}, "
            "or PYTHONPATH to the folder of its module"
        ) from error
    if not (isinstance(found, type) and issubclass(found, nn.Module)):
        raise ValueError(
            f"Expected the class of a torch module as {target}, got another object; "
            f"set {key}.{TARGET}"
        )
    return found


def built(settings: Mapping[str, Any], key: str = "model") -> nn.Module:
    """The network of some settings; settings below them that name a class are built first.

    Args:
        settings: keyword arguments, with the dotted name of the class as `_target_`.
        key: configuration key to name in errors.

    Raises:
        ValueError: there is no such class, or it does not take these settings.

    Example:
        >>> built({"_target_": "torch.nn.Linear", "in_features": 2, "out_features": 1})
        Linear(in_features=2, out_features=1, bias=True)
    """
    kind = class_of(settings, key)
    given = {name: _value(x, f"{key}.{name}") for name, x in settings.items() if name != TARGET}
    try:
        return kind(**given)
    except TypeError as error:
        raise ValueError(
            f"Expected settings that {settings[TARGET]} takes, got: {error}; set those below {key}"
        ) from error


def _value(value: Any, key: str) -> Any:  # noqa: ANN401
    if isinstance(value, Mapping):
        if TARGET in value:
            return built(value, key)
        return {name: _value(each, f"{key}.{name}") for name, each in value.items()}
    if isinstance(value, list):
        return [_value(each, key) for each in value]
    return value
