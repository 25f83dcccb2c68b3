"""Small buses with one thing wrong, and what the diagnosis says of them."""

from __future__ import annotations

from collections.abc import Sequence

from buses import CHAR_NS, LINE

from analyzer.core import analyse
from analyzer.options import Options
from analyzer.tables.findings import Finding, described
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

MS = 1_000_000
REQUEST = bytes.fromhex("1103006b00037687")
ANSWER = bytes.fromhex("110306ae415652434049ad")


def with_crc(text: str) -> bytes:
    """An RTU ADU from hex without its CRC."""
    data = bytes.fromhex(text)
    return data + crc_bytes(data)


class Wire:
    """Frames put on a wire one after the other, as a tap that sees each byte would give them."""

    def __init__(self, char_ns: int = CHAR_NS) -> None:
        self.char_ns = char_ns
        self.now = 1_000 * MS
        self.chunks: list[Chunk] = []
        self.offset = 0

    def silence(self, ms: float) -> Wire:
        self.now += round(ms * MS)
        return self

    def send(self, data: bytes, errors: Sequence[int] = ()) -> int:
        """Sends bytes end to end; returns where they begin in the stream."""
        start = self.offset
        for i, byte in enumerate(data):
            self.now += self.char_ns
            self.chunks.append(Chunk(self.now, bytes([byte]), errors=(0,) if i in errors else ()))
        self.offset += len(data)
        return start

    def exchange(self, request: bytes = REQUEST, answer: bytes | None = ANSWER, *, wait_ms: float = 8) -> Wire:
        """A healthy poll: 20 ms of silence, a request, its answer."""
        self.silence(20).send(request)
        if answer is not None:
            self.silence(wait_ms).send(answer)
        else:
            self.silence(200)
        return self

    def polls(self, count: int) -> Wire:
        """Healthy polls of several units."""
        for i in range(count):
            unit = (1, 17, 2)[i % 3]
            body = bytes([unit]) + ANSWER[1:-2]
            self.exchange(with_crc(f"{unit:02x}03006b0003"), body + crc_bytes(body))
        return self


def diagnosed(wire: Wire, line: LineSettings = LINE, options: Options | None = None) -> list[Finding]:
    """All findings on a wire."""
    capture = Capture.of(line, wire.chunks)
    analysed = analyse(capture, options or Options())
    return [finding for batch in analysed for finding in described(batch.findings)]


def said(findings: Sequence[Finding]) -> list[tuple[str, int]]:
    """(code, start) of each finding that is not about the whole bus."""
    return [(f.code, f.start) for f in findings if f.start >= 0]
