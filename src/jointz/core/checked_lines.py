"""Lines of text that carry their CRC-32."""

import zlib


def checked_line(text: bytes) -> bytes:
    """Return a text with its CRC-32, as a line.

    Parameters
    ----------
    text : bytes
        Without the end of a line in it.
    """
    return text + b" %08x\n" % zlib.crc32(text)


def checked_text(line: bytes) -> bytes | None:
    """Return the text of a line, None where its checksum does not fit.

    Parameters
    ----------
    line : bytes
        Without its end.
    """
    text, _, check = line.rpartition(b" ")
    return text if check == b"%08x" % zlib.crc32(text) else None
