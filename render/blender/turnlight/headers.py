"""Whether an image is what it is said to be, told before anything decodes it.

A PNG is followed to its end: chunks, checksums, and as many bytes of rows as its header asks for, so that nothing
broken and nothing oversized reaches a decoder. Of a JPEG the declared size is checked.
"""

import struct
import zlib

PNG = b"\x89PNG\r\n\x1a\n"
# Bit depth 8, colour type 2 (RGB), deflate, the five filters, no interlace.
PLAIN = bytes([8, 2, 0, 0, 0])
# Bytes of rows looked at at once.
STEP = 1 << 20


def check_image(data, size):
    """Raises ValueError, which goes behind the name of the image, unless `data` is a picture of `size`."""
    if data[:8] == PNG:
        found = _check_png(data, size)
    elif data[:2] == b"\xff\xd8":
        found = _size_of_jpeg(data)
    else:
        raise ValueError("is neither PNG nor JPEG")
    if found != tuple(size):
        raise ValueError(f"is {found[0]}×{found[1]} where {size[0]}×{size[1]} is declared")


def _check_png(data, size):
    rows, at = None, 8
    while at + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 12 + length
        if end > len(data):
            break
        body = data[at + 8 : end - 4]
        if rows is None:
            found = _header_of_png(kind, body)
            if found != tuple(size):
                return found
            rows = _Rows((3 * found[0] + 1) * found[1])
        elif kind == b"IDAT":
            rows.take(body)
        elif kind == b"IEND":
            rows.finish()
            return found
        if zlib.crc32(data[at + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise ValueError(f"is damaged (chunk {kind!r})")
        at = end
    raise ValueError("is cut off")


def _header_of_png(kind, body):
    if kind != b"IHDR" or body[8:] != PLAIN:
        raise ValueError("is no PNG of 8-bit RGB without interlace")
    return struct.unpack_from(">II", body)


class _Rows:
    """Counts the bytes a stream inflates to, without keeping them."""

    def __init__(self, wanted):
        self.left = wanted
        self.stream = zlib.decompressobj()

    def take(self, body):
        try:
            while body and not self.stream.eof:
                self.left -= len(self.stream.decompress(body, STEP))
                body = self.stream.unconsumed_tail
                if self.left < 0:
                    break
        except zlib.error:
            self.left = -1
        self._check(self.left < 0)

    def finish(self):
        self._check(self.left != 0)

    def _check(self, is_wrong):
        if is_wrong:
            raise ValueError("does not decompress to its size")


def _size_of_jpeg(data):
    at = 2
    while at + 9 <= len(data):
        marker, length = struct.unpack_from(">HH", data, at)
        # Start of frame, of any kind; C4, C8 and CC share the range and are none.
        if 0xFFC0 <= marker <= 0xFFCF and marker not in (0xFFC4, 0xFFC8, 0xFFCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        if marker >> 8 != 0xFF:
            break
        at += 1 if marker == 0xFFFF else 2 + length
    raise ValueError("is no JPEG with a size")
