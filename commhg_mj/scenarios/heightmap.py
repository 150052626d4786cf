"""Heightmaps: from a user's PNG to the text that a scenario holds, and back to heights.

A scenario carries the picture itself, not its file's name: a trace stores its scenario and makes the same world again
wherever it is read. So the picture is brought to PIXELS² pixels of 8 bits and written as the base64 of a PNG.
"""

import base64
import binascii
import struct
import zlib
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

PIXELS = 128  # a side: as fine as the mountains' surfaces that 48 ellipses can carry (models/relief.py)
MOST_PIXELS = 64_000_000  # of a picture that is read
PLAIN = 0.02  # of white: darker ground is the plain
HEADER = struct.Struct(">8s4x4sIIBB")  # of a PNG: signature, length, IHDR, width, height, bits, colour type
GREY = 0  # PNG's colour type
LUMA = np.array([114, 587, 299])  # weights of blue, green and red in brightness (ITU-R BT.601)
SIGNATURE = b"\x89PNG\r\n\x1a\n"
WORD = 4  # bytes: a PNG's chunk is its length, its kind, as many bytes, and a checksum of the kind and these


def read_heightmap(path) -> str:
    """The content of the field world.heightmap for a picture.

    Args:
      path: a square PNG, black for the plain and white for the highest ground, north up. Colours count by their
        brightness, transparency not at all.

    Raises:
      ValueError: not such a picture; the message names the field and the file.
    """
    where = f"world.heightmap: {path}"
    try:
        png = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        raise ValueError(f"{where}: {getattr(error, 'strerror', None) or error}") from None
    width, height, *_ = _header(png, where)
    if width != height:
        raise ValueError(f"{where}: the picture of the square map must be square, is {width}x{height}")
    if width * height > MOST_PIXELS:
        raise ValueError(f"{where}: {width}x{height} are too many pixels, at most {MOST_PIXELS / 1e6:g} million are read")
    picture = _decode(png, where)
    white = np.iinfo(picture.dtype).max
    if picture.ndim == 3:
        picture, white = picture[..., :3] @ LUMA, LUMA.sum() * white
    share = _reduce(picture) / (white * width**2) if width > PIXELS else _enlarge(picture / white)
    if share.max() <= PLAIN:
        raise ValueError(
            f"{where}: nothing in it is brighter than the plain ({PLAIN:.0%} of white): stretch its greys, or use "
            "world.n_mountains = 0 for a flat world"
        )
    return to_text(share)


def to_text(share) -> str:
    """The field's content for brightnesses [PIXELS, PIXELS] in 0..1, first row in the north."""
    grey = np.rint(255 * np.asarray(share)).astype(np.uint8)
    return base64.b64encode(cv2.imencode(".png", grey, [cv2.IMWRITE_PNG_COMPRESSION, 9])[1]).decode()


def bilinear(table, x, y) -> np.ndarray:
    """Values of table [rows, columns] at columns x and rows y, arrays of one shape: linear between, beyond the rim as on it."""
    cells = []
    for place, n in ((x, table.shape[1]), (y, table.shape[0])):
        place = np.clip(place, 0, n - 1)
        first = np.minimum(place.astype(int), max(n - 2, 0))
        cells.append((first, np.minimum(first + 1, n - 1), place - first))
    (west, east, u), (south, north, v) = cells
    low = table[south, west] + u * (table[south, east] - table[south, west])
    high = table[north, west] + u * (table[north, east] - table[north, west])
    return low + v * (high - low)


def _enlarge(share):
    """A picture [n, n] in PIXELS² pixels."""
    centres = (np.arange(PIXELS) + 0.5) * len(share) / PIXELS - 0.5
    return bilinear(share, *np.meshgrid(centres, centres))


def _reduce(picture):
    """Sums [PIXELS, PIXELS] of a picture [n, n] of whole numbers over its blocks, each of n² PIXELS²-ths of a pixel.

    In whole numbers: means of few pixels lie on the edge of rounding, where OpenCV's order depends on the processor.
    """
    edges, within = np.divmod(np.arange(PIXELS + 1) * len(picture), PIXELS)
    for _ in "yx":
        until = np.pad(np.cumsum(picture, axis=0, dtype=np.int64), ((1, 0), (0, 0)))[edges]
        following = np.pad(picture, ((0, 1), (0, 0)))[edges].astype(np.int64)
        picture = np.diff(PIXELS * until + within[:, None] * following, axis=0).T
    return picture


@lru_cache(maxsize=64)
def brightness(text) -> np.ndarray:
    """What `to_text` wrote: [PIXELS, PIXELS] in 0..1, first row in the SOUTH, so that rows follow y; not writable.

    Raises:
      ValueError: it did not write this; the message names the field.
    """
    where = f"world.heightmap must be the base64 of a PNG of {PIXELS}x{PIXELS} grey pixels (commhg_mj.with_heightmap)"
    try:
        png = base64.b64decode(text, validate=True)
    except (TypeError, ValueError, binascii.Error):
        raise ValueError(where) from None
    if _header(png, where) != (PIXELS, PIXELS, 8, GREY):
        raise ValueError(f"{where}: another size or kind of pixels")
    share = _decode(png, where)[::-1] / 255
    share.flags.writeable = False
    return share


def _header(png, where):
    """(width, height, bits, colour type) of a PNG, before anything of it is decoded."""
    if len(png) >= HEADER.size:
        signature, kind, *facts = HEADER.unpack_from(png)
        if signature == SIGNATURE and kind == b"IHDR":
            return tuple(facts)
    raise ValueError(f"{where}: not a PNG picture")


def _decode(png, where):
    """Pixels of a PNG [height, width(, channels)]."""
    whole = _up_to_end(png)
    picture = cv2.imdecode(np.frombuffer(whole, np.uint8), cv2.IMREAD_UNCHANGED) if whole else None
    if picture is None:
        raise ValueError(f"{where}: a damaged PNG picture")
    return picture


def _up_to_end(png) -> bytes:
    """A PNG without what follows its end; nothing if it was cut off or bent, which OpenCV would tell on standard error."""
    start = len(SIGNATURE)
    while start < len(png):
        end = start + 3 * WORD + int.from_bytes(png[start : start + WORD], "big")
        content, checksum = png[start + WORD : end - WORD], png[end - WORD : end]
        kind = content[:WORD]
        if end > len(png) or (kind[:1].isupper() and zlib.crc32(content) != int.from_bytes(checksum, "big")):
            break  # upper case: readers need this chunk
        if kind == b"IEND":
            return png[:end]
        start = end
    return b""
