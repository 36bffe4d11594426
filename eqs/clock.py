"""What to do where times run backwards: sort, or unwrap a clock that began again."""

from __future__ import annotations

WRAPS = {2**32: "2^32", 2**31: "2^31"}


def backwards(before_us: int, after_us: int, otherwise: str = "sort the stream by t first") -> str:
    """Advice for a time that does not follow the one before it, as the end of a sentence.

    Args:
        before_us: the earlier of two times in the stream.
        after_us: the one that should come after it.
        otherwise: the advice where no clock began again.

    Example:
        >>> backwards(4_294_967_290, 7)
        'unwrap the clock, which began again at 2^32: add 4294967296 to every time from there on'
        >>> backwards(9, 7)
        'sort the stream by t first'
    """
    for wrap, name in WRAPS.items():
        if before_us - after_us > wrap - wrap // 4:
            return (
                f"unwrap the clock, which began again at {name}: add {wrap} to every time from "
                "there on"
            )
    return otherwise
