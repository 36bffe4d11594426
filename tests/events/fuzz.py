"""Damages files of one format in many ways, reads each, and prints what came of it.

Run in a process of its own, which a library may end or hang: `python fuzz.py FOLDER CASES NAME...`
prints a format's name and the number of a case before it, and after it how it ended.
"""

import signal
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
from event_files import SIZE, TOLD, WRITERS

from eqs.data.foreign_frames import foreign_frames
from eqs.events import Events
from eqs.events.formats import decode, is_dsec
from eqs.events.hints import Hints
from eqs.events.ordered import OrderedFile

EVENTS, CONSTANT, SECONDS = 400, 8 << 20, 10
HEADER = 600  # bytes that decide over how the others are read


def stream():
    generator = np.random.default_rng(5)
    t = 1_000_000 + np.sort(generator.integers(0, 90_000, EVENTS))
    x, y, p = (generator.integers(0, high, EVENTS) for high in (SIZE["width"], SIZE["height"], 2))
    return Events.from_arrays(t, x, y, p, **SIZE)


def cut(content, generator):
    return content[: generator.integers(0, len(content) + 1)]


def flip(content, generator):
    damaged = bytearray(content)
    for _ in range(generator.integers(1, 17)):
        reach = len(content) if generator.random() < 0.5 else min(HEADER, len(content))
        damaged[generator.integers(0, reach)] = generator.integers(0, 256)
    return bytes(damaged)


def splice(content, generator):
    start, stop = np.sort(generator.integers(0, len(content) + 1, 2))
    at = generator.integers(0, len(content) + 1)
    after = at if generator.random() < 0.5 else at + stop - start
    return content[:at] + content[start:stop] + content[after:]


def blank(content, generator):
    start, stop = np.sort(generator.integers(0, len(content) + 1, 2))
    return content[:start] + bytes(stop - start) + content[stop:]


def repeat(content, generator):
    start, stop = np.sort(generator.integers(0, len(content) + 1, 2))
    return content[:stop] + content[start:stop] * int(generator.integers(1, 4)) + content[stop:]


def damaged(content, seed):
    """A file that differs from a whole one by up to three mutations."""
    generator = np.random.default_rng(seed)
    for _ in range(generator.integers(1, 4)):
        mutate = generator.choice([cut, flip, flip, splice, blank, repeat])
        content = mutate(content, generator) if content else content
    return content


def read(path, told, whole):
    """The events of a file, once its frames, if it has any, have been read too."""
    if whole:
        sum(frame.picture.size for frame in foreign_frames(path))
    hints = Hints(**told)
    if is_dsec(path):
        return [Events.load(path, hints.height, hints.width)]
    if whole:
        return [decode(path, hints).events(hints.height, hints.width)]
    return list(OrderedFile(path, hints, size=509))


def fault(events):
    """What is wrong with a stream, if anything."""
    t = np.concatenate([part.t for part in events])
    if np.any(np.diff(t) < 0):
        return "unsorted"
    inside = all(
        (part.x < part.width).all() and (part.y < part.height).all() and (part.p < 2).all()
        for part in events
    )
    return None if inside else "outside of the sensor"


def outcome(path, told, whole):
    """How reading a damaged file ends, in one line."""
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    start = time.perf_counter()
    try:
        events = read(path, told, whole)
        wrong = fault(events)
        ended = f"FAULT {wrong}" if wrong else f"events {sum(len(part) for part in events)}"
    except (ValueError, FileNotFoundError) as error:
        told_well = "xpected" in str(error) and "got" in str(error)
        kind = "refused" if told_well else f"FAULT {type(error).__name__} without a sentence:"
        ended = f"{kind} {error}"
    except BaseException as error:
        ended = f"FAULT {type(error).__name__} {error}"
    signal.setitimer(signal.ITIMER_REAL, 0)
    peak = tracemalloc.get_traced_memory()[1] - before
    if peak > 2 * path.stat().st_size + CONSTANT:
        ended = f"FAULT {peak / 1e6:.0f} MB held for {path.stat().st_size} bytes, {ended}"
    if (took := time.perf_counter() - start) > SECONDS / 2:
        ended = f"FAULT {took:.0f} s, {ended}"
    return " ".join(ended.encode("ascii", "backslashreplace").decode().split())[:300]


def late(*_):
    raise TimeoutError(f"after {SECONDS} s")


def say(line):
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main(folder, cases, *names):
    signal.signal(signal.SIGALRM, late)
    for name in names:
        path = Path(folder) / name
        WRITERS[name](path, stream())
        told = TOLD.get(name, {}) if name == "h.aedat" else {**TOLD.get(name, {}), **SIZE}
        if name == "g.aedat":
            told = {}  # whose chip is larger
        content = path.read_bytes()
        for whole in (True, False):  # which also loads and compiles everything
            assert sum(len(part) for part in read(path, told, whole)) == EVENTS
        tracemalloc.start()
        for seed in range(int(cases)):
            target = path.with_name(f"{seed}_{name}")
            target.write_bytes(damaged(content, seed))
            say(f"{name} {seed}")
            say(outcome(target, told, seed % 2))
            target.unlink()
        tracemalloc.stop()


if __name__ == "__main__":
    main(*sys.argv[1:])
