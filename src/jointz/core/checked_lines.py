"""Lines of text that carry their CRC-32."""

import zlib


def checked_line(text: bytes) -> bytes:
    """Return a text with its CRC-32, as a line."""
    return text + b" %08x\n" % zlib.crc32(text)


def checked_text(line: bytes) -> bytes | None:
    """Return the text of a line, None where its checksum does not fit."""
    text, _, check = line.rpartition(b" ")
    return text if check == b"%08x" % zlib.crc32(text) else None
