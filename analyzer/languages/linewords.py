"""How a line is set, in words: one form for the report, the sheets, `info`, the bar and the causes."""

from __future__ import annotations

from collections.abc import Iterator

from captures.line import LineSettings

from . import page_words


def line_words(line: LineSettings) -> str:
    """`19200 bit/s, 8E1, tap irq`; how long a character is where its parity is not known."""
    return ", ".join(_parts(line))


def _parts(line: LineSettings) -> Iterator[str]:
    yield page_words("baud not known") if line.baud is None else page_words("{baud} bit/s", baud=line.baud)
    if (written := line.character_format) is not None:
        yield written
    else:
        if line.char_bits is not None:
            yield page_words("{bits:g}-bit characters", bits=line.char_bits)
        if line.parity is not None:
            yield page_words("parity {parity}", parity=line.parity)
    if line.tap:
        yield page_words("tap {tap}", tap=line.tap)
