"""Event files of other programs, written by the descriptions of their formats."""

import numpy as np

HEIGHT, WIDTH = 48, 64
SIZE = {"height": HEIGHT, "width": WIDTH}


def rows(events):
    return np.stack([events.t, events.x, events.y, events.p], axis=1).astype(np.int64)


def evt2(events):
    words, high = [], None
    for t, x, y, p in rows(events).tolist():
        if t >> 6 != high:
            high = t >> 6
            words.append(8 << 28 | high & 0x0FFFFFFF)
        words.append(p << 28 | (t & 63) << 22 | x << 11 | y)
    return (
        f"% evt 2.0\n% geometry {WIDTH}x{HEIGHT}\n% end\n".encode()
        + np.array(words, "<u4").tobytes()
    )


def evt21(events):
    words, high = [], None
    for t, x, y, p in rows(events).tolist():
        if t >> 6 != high:
            high = t >> 6
            words.append(8 << 60 | (high & 0x0FFFFFFF) << 32)
        base, lane = x // 32 * 32, x % 32
        words.append(p << 60 | (t & 63) << 54 | base << 43 | y << 32 | 1 << lane)
    header = f"% evt 2.1\n% width {WIDTH}\n% height {HEIGHT}\n% end\n".encode()
    return header + np.array(words, "<u8").tobytes()


def evt3(events, vectors=True):
    words, high = [], None
    for index, (t, x, y, p) in enumerate(rows(events).tolist()):
        if t >> 12 != high:
            high = t >> 12
            words.append(8 << 12 | high & 0xFFF)
        words += [6 << 12 | t & 0xFFF, y]
        if vectors and index % 2:
            base = max(0, x - 15)
            words.append(3 << 12 | p << 11 | base)
            # Empty lanes move the base on until the event's lane comes.
            words += [4 << 12 | (1 << (x - base) if x - base < 12 else 0)]
            if x - base >= 12:
                words.append(5 << 12 | 1 << (x - base - 12))
        else:
            words.append(2 << 12 | p << 11 | x)
    header = f"% format EVT3;height={HEIGHT};width={WIDTH}\n% evt 3.0\n% end\n".encode()
    return header + np.array(words, "<u2").tobytes()


def dat(events):
    table = rows(events)
    data = table[:, 1] | table[:, 2] << 14 | table[:, 3] << 28
    pairs = np.stack([table[:, 0], data], axis=1).astype("<u4")
    header = f"% Version 2\n% Width {WIDTH}\n% Height {HEIGHT}\n".encode()
    return header + b"\x0c\x08" + pairs.tobytes()


def aedat3(events):
    table = rows(events)
    data = 1 | table[:, 3] << 1 | table[:, 2] << 2 | table[:, 1] << 17
    body = np.stack([data, table[:, 0]], axis=1).astype("<u4").tobytes()
    head = np.array([1, 0], "<i2").tobytes()
    head += np.array([8, 4, 0, len(table), len(table), len(table)], "<i4").tobytes()
    special = np.array([0, 0], "<i2").tobytes() + np.array([8, 4, 0, 1, 1, 1], "<i4").tobytes()
    return b"#!AER-DAT3.1\r\n#Format: RAW\r\n#!END-HEADER\r\n" + special + b"\0" * 8 + head + body


def event_stream(events):
    content = bytearray(
        b"Event Stream\x02\x00\x00\x01" + np.array([WIDTH, HEIGHT], "<u2").tobytes()
    )
    now = int(events.t[0]) - int(events.t[0])
    for t, x, y, p in rows(events).tolist():
        wait = t - int(events.t[0]) - now
        content += b"\xff" * (wait // 127)
        content.append((wait % 127) << 1 | p)
        content += np.array([x, HEIGHT - 1 - y], "<u2").tobytes()
        now = t - int(events.t[0])
    return bytes(content)


ENCODERS = {
    "a.raw": evt2, "b.raw": evt21, "c.raw": evt3, "d.dat": dat, "e.aedat": aedat3,
    "f.es": event_stream,
}  # fmt: skip


def aedat2(events):
    table = rows(events)
    x, y, p = (table[:, column] for column in (1, 2, 3))
    address = (1 - p) | (127 - x) << 1 | (127 - y) << 8
    pairs = np.stack([address, table[:, 0] % (1 << 32)], axis=1)
    return b"#!AER-DAT2.0\r\n# AEChip: a.b.DVS128\r\n" + pairs.astype(">u4").tobytes()


def aedat2_of_v2e(events, height=180, width=240):
    table = rows(events)
    address = (width - 1 - table[:, 1]) << 12 | (height - 1 - table[:, 2]) << 22 | table[:, 3] << 11
    pairs = np.stack([address, table[:, 0]], axis=1)
    header = (
        b"#!AER-DAT2.0\r\n# This is a raw AE data file created by AEDat2Output in v2e (see x)\r\n"
    )
    return header + pairs.astype(">u4").tobytes()


def forty_bits(events):
    content, turns = bytearray(), 0
    for t, x, y, p in rows(events).tolist():
        while t - turns * (1 << 13) >= 1 << 23:
            content += bytes([0, 240, 0, 0, 0])
            turns += 1
        t -= turns * (1 << 13)
        content += bytes([x, y, p << 7 | t >> 16, t >> 8 & 255, t & 255])
    return bytes(content)


def text(events):
    return "".join(f"{t / 1e6:.6f} {x} {y} {p}\n" for t, x, y, p in rows(events).tolist()).encode()


def csv(events):
    lines = [f"{x},{y},{2 * p - 1},{t}\r\n" for t, x, y, p in rows(events).tolist()]
    return "\r\n".join(["# made for a test", "x,y,polarity,timestamp", *lines]).encode()
