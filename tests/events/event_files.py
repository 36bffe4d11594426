"""Event files of other programs, written by the descriptions of their formats."""

import io
import zipfile

import h5py
import numpy as np
from PIL import Image
from rosbags import rosbag1, rosbag2
from scipy.io import savemat

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
    x, y, p = width - 1 - table[:, 1], height - 1 - table[:, 2], table[:, 3]
    address = x << 1 | y << 11 | p if width == 640 else x << 12 | y << 22 | p << 11
    pairs = np.stack([address, table[:, 0]], axis=1)
    header = b"#!AER-DAT2.0\r\n# This is a file created by AEDat2Output in v2e (see x)\r\n"
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


def flat(identifier, fields):
    """A flatbuffer of one table, its size before it: numbers lie in it, bytes behind it."""
    table, behind = bytearray(4), bytearray()
    places, later = [], []
    for kind, value in fields:
        table += bytes(-len(table) % np.dtype(kind).itemsize)
        places.append(len(table))
        if isinstance(value, bytes):
            later.append((len(table), value))
            value = 0
        table += np.array(value, kind).tobytes()
    vtable = np.array([4 + 2 * len(places), len(table), *places], "<u2").tobytes()
    # Size, place of the table and identifier come first; numbers of 64 bits are aligned.
    start = 12 + len(vtable) + -(12 + len(vtable)) % 8
    table[:4] = np.array(len(vtable), "<i4").tobytes()
    stop = start + len(table)
    for place, value in later:
        behind += bytes(-(stop + len(behind) + 4) % 8)
        distance = stop + len(behind) - (start + place)
        table[place : place + 4] = np.array(distance, "<u4").tobytes()
        behind += value
    gap = bytes(start - len(vtable) - 12)
    content = np.array(start - 4, "<u4").tobytes() + identifier + gap + vtable + table + behind
    return np.array(len(content), "<u4").tobytes() + content


def vector(elements, count):
    return np.array(count, "<u4").tobytes() + elements


INFO = (
    """<dv version="2.0"><node name="outInfo" path="/mainloop/Recorder/outInfo/">{}</node></dv>"""
)
STREAM = """<node name="{0}" path="/mainloop/Recorder/outInfo/{0}/">
<attr key="compression" type="string">NONE</attr>
<attr key="originalModuleName" type="string">capture</attr>
<attr key="originalOutputName" type="string">{1}</attr>
<attr key="typeDescription" type="string">{1}</attr>
<attr key="typeIdentifier" type="string">{2}</attr>
<node name="info" path="/mainloop/Recorder/outInfo/{0}/info/">
<attr key="sizeX" type="int">{3}</attr><attr key="sizeY" type="int">{4}</attr>
<attr key="source" type="string">test</attr><attr key="tsOffset" type="long">0</attr>
</node></node>"""


def aedat4(events, frames=(), compression=0, compress=bytes):
    """Events, then frames of (time, start and stop of the exposure, picture of 8 bits)."""
    streams = [STREAM.format(0, "events", "EVTS", WIDTH, HEIGHT)]
    packed = np.zeros(
        len(events), {"names": ["t", "x", "y", "p"], "formats": ["<i8", "<i2", "<i2", "u1"],
                      "offsets": [0, 8, 10, 12], "itemsize": 16},
    )  # fmt: skip
    for name in "txyp":
        packed[name] = getattr(events, name)
    packets = [(0, flat(b"EVTS", [("<u4", vector(packed.tobytes(), len(packed)))]))]
    if frames:
        streams.append(STREAM.format(1, "frames", "FRME", WIDTH, HEIGHT))
    for time, start, stop, picture in frames:
        height, width = picture.shape[:2]
        kind = 16 if picture.ndim == 3 else 0  # of OpenCV: three channels of blue, green, red
        pixels = np.ascontiguousarray(picture[..., ::-1] if kind else picture).tobytes()
        numbers = [("<i8", each) for each in (time, start, stop, start, stop)]
        numbers += [("i1", kind), ("<i2", width), ("<i2", height), ("<i2", 0), ("<i2", 0)]
        packets.append((1, flat(b"FRME", [*numbers, ("<u4", vector(pixels, len(pixels)))])))
    xml = INFO.format("".join(streams)).encode()
    header = flat(
        b"IOHE", [("<i4", compression), ("<i8", -1), ("<u4", vector(xml + b"\0", len(xml)))]
    )
    packed_packets = [(stream, compress(content)) for stream, content in packets]
    body = b"".join(
        np.array([stream, len(content)], "<i4").tobytes() + content
        for stream, content in packed_packets
    )
    return b"#!AER-DAT4.0\r\n" + header + body


class Serialised:
    """A ROS message: fields behind each other, aligned as CDR wants it, or not."""

    def __init__(self, ros1):
        self.ros1, self.content = ros1, bytearray() if ros1 else bytearray(b"\0\1\0\0")

    def number(self, value, size):
        if not self.ros1:
            self.content += bytes(-(len(self.content) - 4) % size)
        self.content += int(value).to_bytes(size, "little")

    def bytes(self, value, zero=False):
        value += b"\0" if zero and not self.ros1 else b""
        self.number(len(value), 4)
        self.content += value

    def header(self, frame, time_us=1_000_001, height=480, width=640):
        if self.ros1:
            self.number(1, 4)
        self.number(time_us // 1_000_000, 4)
        self.number(time_us % 1_000_000 * 1000, 4)
        self.bytes(frame, zero=True)
        self.number(height, 4)
        self.number(width, 4)


def packet(encoding, events, ros1, base_ns=0, frame=b"camera", height=480, width=640):
    message = Serialised(ros1)
    message.header(frame, height=height, width=width)
    message.number(1, 8)
    message.number(base_ns, 8)
    message.bytes(encoding, zero=True)
    message.number(0, 1)
    message.bytes(events)
    return bytes(message.content)


def event_array(events, ros1):
    message = Serialised(ros1)
    message.header(b"camera", height=events.height, width=events.width)
    message.number(len(events), 4)
    for t, x, y, p in rows(events).tolist():
        for value, size in ((x, 2), (y, 2), (t // 10**6, 4), (t % 10**6 * 1000, 4), (p, 1)):
            message.number(value, size)
    return bytes(message.content)


def image(picture, encoding, time_us, ros1, padding=0):
    """A message of `sensor_msgs/Image`, whose rows may be longer than their pixels."""
    height, width = picture.shape[:2]
    message = Serialised(ros1)
    message.header(b"camera", time_us, height, width)
    message.bytes(encoding.encode(), zero=True)
    message.number(0, 1)
    rows_of = np.ascontiguousarray(picture).reshape(height, -1)
    padded = np.pad(rows_of, ((0, 0), (0, padding)), constant_values=7)
    message.number(padded.shape[1], 4)
    message.bytes(padded.tobytes())
    return bytes(message.content)


STAMP = "std_msgs/Header header\n"
DEFINITIONS = {
    "dvs_msgs/msg/EventArray": f"{STAMP}uint32 height\nuint32 width\nuint8[] events\n",
    "event_camera_msgs/msg/EventPacket": f"{STAMP}uint32 height\nuint32 width\nuint8[] events\n",
    "sensor_msgs/msg/Image": f"{STAMP}uint32 height\nuint32 width\nuint8[] data\n",
}


def write_bag(path, messages):
    """A bag of (topic, kind, nanoseconds, bytes); the readers here take no note of definitions."""
    ros1 = path.suffix == ".bag"
    if ros1:
        opened = rosbag1.Writer(path)
    else:
        folder = path.with_name(f"{path.stem}_folder")
        plugin = (
            rosbag2.StoragePlugin.MCAP if path.suffix == ".mcap" else rosbag2.StoragePlugin.SQLITE3
        )
        opened = rosbag2.Writer(folder, version=9, storage_plugin=plugin)
    with opened as writer:
        known = {}
        for topic, kind, time_ns, content in messages:
            if topic not in known:
                marks = {"md5sum": "0" * 32} if ros1 else {"rihs01": "RIHS01_" + "0" * 64}
                known[topic] = writer.add_connection(topic, kind, msgdef=DEFINITIONS[kind], **marks)
            writer.write(known[topic], time_ns, content)
    if not ros1:
        next(folder.glob(f"*{path.suffix}")).rename(path)
    return path


def save73(path, variables):
    """What MATLAB writes with -v7.3: a text of 512 bytes, then HDF5 with every array transposed."""

    def put(group, held):
        for name, value in held.items():
            if isinstance(value, dict):
                put(group.create_group(name), value)
            else:
                group[name] = np.atleast_2d(np.asarray(value, float)).T

    with h5py.File(path, "w", userblock_size=512) as file:
        put(file, {**variables, "#refs#": {"a": [1, 2, 3]}})
    with path.open("rb+") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))


def carla(events):
    """CARLA's records, which are packed."""
    kind = [("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("pol", "?")]
    table = np.zeros(len(events), kind)
    for name, values in {
        "x": events.x,
        "y": events.y,
        "t": events.t * 1000,
        "pol": events.p,
    }.items():
        table[name] = values
    return table


def columns(events):
    return {name: getattr(events, name) for name in "txyp"}


def write_hdf5(path, events, places):
    with h5py.File(path, "w") as file:
        for place, value in places.items():
            file.create_dataset(place, data=value, chunks=True, compression="gzip")


def mvsec(events):
    return np.stack([events.x, events.y, events.t / 1e6, 2.0 * events.p - 1], axis=1)


def in_halves(events, ros1):
    half = len(events) // 2
    return [
        ("/dvs/events", "dvs_msgs/msg/EventArray", 1000 + at, event_array(part, ros1))
        for at, part in enumerate([events[:half], events[half:]])
    ]


def shades(count=2):
    """Small pictures of one level each."""
    return [np.full((HEIGHT, WIDTH), 90 * k, np.uint8) for k in range(1, count + 1)]


def aedat4_with_frames(events):
    return aedat4(events, [(t, t, t + 9, each) for t, each in enumerate(shades())])


def bag_with_frames(path, events):
    pictures = [
        ("/image", "sensor_msgs/msg/Image", 2000 + t, image(each, "mono8", t, True))
        for t, each in enumerate(shades())
    ]
    write_bag(path, [*in_halves(events, True), *pictures])


def mvsec_with_frames(path, events):
    write_hdf5(path, events, {
        "davis/left/events": mvsec(events), "davis/left/image_raw": np.stack(shades()),
        "davis/left/image_raw_ts": np.array([1.0, 1.1]),
    })  # fmt: skip


def zip_with_frames(path, events):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a/events.txt", text(events))
        archive.writestr("a/images.txt", "0.1 images/0.png\n0.2 images/1.png\n")
        for index, each in enumerate(shades()):
            picture = io.BytesIO()
            Image.fromarray(each).save(picture, "PNG")
            archive.writestr(f"a/images/{index}.png", picture.getvalue())


def in_packets(events):
    words = evt3(events)
    words = words[words.index(b"% end\n") + 6 :]
    return [
        (
            "/events",
            "event_camera_msgs/msg/EventPacket",
            1000 + at,
            packet(b"evt3", part, False, **SIZE),
        )
        for at, part in enumerate([words[:400], words[400:]])
    ]


def write_zip(path, events):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("calib.txt", "1 2 3 4")
        archive.writestr("events.txt", text(events))


# Every format that is read, by a file's name, and what it does not say.
WRITERS = {
    **{name: lambda path, events, e=e: path.write_bytes(e(events)) for name, e in ENCODERS.items()},
    "g.aedat": lambda path, events: path.write_bytes(aedat2(events)),
    "h.aedat": lambda path, events: path.write_bytes(aedat2_of_v2e(events)),
    "i.bin": lambda path, events: path.write_bytes(forty_bits(events)),
    "j.txt": lambda path, events: path.write_bytes(text(events)),
    "k.csv": lambda path, events: path.write_bytes(csv(events)),
    "l.aedat4": lambda path, events: path.write_bytes(aedat4(events)),
    "m.bag": lambda path, events: write_bag(path, in_halves(events, True)),
    "n.db3": lambda path, events: write_bag(path, in_halves(events, False)),
    "o.mcap": lambda path, events: write_bag(path, in_packets(events)),
    "p.npy": lambda path, events: np.save(path, rows(events)),
    "q.npz": lambda path, events: np.savez_compressed(path, **columns(events)),
    "r.zip": write_zip,
    "s.mat": lambda path, events: savemat(path, {"TD": columns(events)}, do_compression=True),
    "t.mat": lambda path, events: save73(path, columns(events)),
    "u.h5": lambda path, events: events.save(path),
    "v.h5": lambda path, events: write_hdf5(path, events, {"events": rows(events).astype("u4")}),
    "w.h5": lambda path, events: write_hdf5(
        path, events, {f"events/{n}s": v for n, v in columns(events).items()}
    ),
    "x.hdf5": mvsec_with_frames, "y.bag": bag_with_frames, "z.zip": zip_with_frames,
    "carla.npy": lambda path, events: np.save(path, carla(events)),
    "carla.raw": lambda path, events: path.write_bytes(carla(events).tobytes()),
    "frames.aedat4": lambda path, events: path.write_bytes(aedat4_with_frames(events)),
}  # fmt: skip
TOLD = {
    "h.aedat": {"height": 180, "width": 240}, "k.csv": {"time_unit": "us"},
    "p.npy": {"time_unit": "us", "order": "txyp"}, "q.npz": {"time_unit": "us"},
    "s.mat": {"time_unit": "us"}, "t.mat": {"time_unit": "us"}, "u.h5": {},
}  # fmt: skip
