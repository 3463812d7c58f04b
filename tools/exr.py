"""OpenEXR images as limn writes them (scan lines, zipped or plain), and plain ones to read."""

import struct
import zlib

import numpy as np

MAGIC = 20000630
TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
PLAIN, ZIP_ONE_LINE, ZIP = 0, 2, 3


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode("latin-1"), end + 1


def _attributes(data):
    """{name: bytes} and where the header ends."""
    at, found = 8, {}
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (size,) = struct.unpack_from("<i", data, at)
        found[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return found, at + 1


def _channels(value):
    at, channels = 0, []
    while value[at]:
        name, at = _text(value, at)
        (kind,) = struct.unpack_from("<i", value, at)
        channels.append((name, TYPES[kind]))
        at += 16
    return channels


def _unzipped(block, size):
    """Undoes zip, the differences of bytes and their interleaving."""
    if len(block) == size:
        return block
    coded = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
    coded[1:] -= 128
    plain = np.cumsum(coded).astype(np.uint8)
    half = (size + 1) // 2
    mixed = np.empty(size, np.uint8)
    mixed[0::2], mixed[1::2] = plain[:half], plain[half:]
    return mixed.tobytes()


def read(file):
    """{channel: H by W in double}."""
    with open(file, "rb") as stream:
        data = stream.read()
    attributes, at = _attributes(data)
    compression = attributes["compression"][0]
    if struct.unpack_from("<i", data)[0] != MAGIC or compression not in (PLAIN, ZIP_ONE_LINE, ZIP):
        raise ValueError(f"{file}: not an image as limn writes them")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    channels = _channels(attributes["channels"])
    lines = 16 if compression == ZIP else 1
    line_bytes = sum(kind.itemsize for _, kind in channels) * width
    image = {name: np.zeros((height, width)) for name, _ in channels}
    for start in struct.unpack_from(f"<{-(-height // lines)}Q", data, at):
        first, size = struct.unpack_from("<2i", data, start)
        first -= top
        count = min(lines, height - first)
        block = _unzipped(data[start + 8 : start + 8 + size], count * line_bytes)
        place = 0
        for row in range(first, first + count):
            for name, kind in channels:
                image[name][row] = np.frombuffer(block, kind, width, place)
                place += kind.itemsize * width
    return image


def grey(file):
    """H by W: the only channel, or the mean of all."""
    return np.mean(list(read(file).values()), axis=0)


def _attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def rgb_bytes(image):
    """A file's content. image: H by W; three equal channels in half precision, not compressed."""
    height, width = image.shape
    channels = b"".join(
        name + b"\0" + struct.pack("<iBBBBii", 1, 0, 0, 0, 0, 1, 1) for name in (b"B", b"G", b"R")
    )
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = struct.pack("<ii", MAGIC, 2) + b"".join(
        _attribute(*entry)
        for entry in (
            ("channels", "chlist", channels + b"\0"),
            ("compression", "compression", b"\0"),
            ("dataWindow", "box2i", window),
            ("displayWindow", "box2i", window),
            ("lineOrder", "lineOrder", b"\0"),
            ("pixelAspectRatio", "float", struct.pack("<f", 1)),
            ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
            ("screenWindowWidth", "float", struct.pack("<f", 1)),
        )
    )
    header += b"\0"
    line = 8 + 6 * width
    first = len(header) + 8 * height
    rows = np.zeros(height, np.dtype([("y", "<i4"), ("size", "<i4"), ("data", "<f2", (3, width))]))
    rows["y"], rows["size"] = np.arange(height), 6 * width
    rows["data"] = image.astype(np.float16)[:, None, :]
    table = struct.pack(f"<{height}Q", *(first + line * y for y in range(height)))
    return header + table + rows.tobytes()
