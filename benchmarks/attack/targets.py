"""What inputs are fed to, and what it may raise: the errors that a user is told in a line, and no other."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from functools import cache, partial
from random import Random
from typing import Final, Literal

import numpy as np

import captures
from attack.languages import rules
from attack.loglines import log_lines
from attack.seedfiles import repacked, seeds_of
from attack.target import LINE, Target, conversation, folder
from captures import Capture, CaptureError, Chunk, LineSettings, Mark
from captures.errors import HexError
from captures.formats import formats
from captures.limits import TIME_LIMIT

_ZIPPED: Final = ("sigrok", "analyser-session")


def _capture_seeds(name: str) -> Sequence[bytes]:
    """Good files of a format: written where it can be written, texts where it is one."""
    chosen, seeds = formats()[name], []
    for number, count in enumerate((1, 2, 4, 12)):
        if chosen.write is None:
            break
        file = io.BytesIO()
        captures.write(file, Capture.of(LINE, conversation(Random(number), count)), format=name)
        seeds.append(file.getvalue())
    return [*seeds, *seeds_of(name)] or TEXTS


def _read(name: str) -> Callable[[bytes, Random], None]:
    def take(data: bytes, chance: Random) -> None:
        path = folder() / f"input{chance.choice(formats()[name].suffixes)}"
        if name in _ZIPPED and chance.random() < 0.7:
            data = repacked(chance.choice(seeds_of(name)), chance)
        path.write_bytes(data)
        capture = captures.open(path, format=name if chance.random() < 0.7 else None)
        newest: dict[int, int] = {}
        for block in capture.blocks(chance.choice((1000, 1 << 20))):
            assert len(block.offsets) == len(block) + 1
            assert block.offsets[-1] - block.offsets[0] == len(block.data)
            assert (np.diff(block.offsets) > 0).all()
            for port in np.unique(block.port).tolist():
                times = block.t_ns[block.port == port]
                assert (np.diff(times) >= 0).all()
                assert newest.get(port, -TIME_LIMIT) <= times[0]
                newest[port] = int(times[-1])
        assert all("\n" not in str(damage) for damage in capture.damage)
        if name == "mcap":
            from captures.recording.notes import read

            read(path)

    return take


TEXTS: Final = (
    b"11 03 00 6B 00 03 76 87\n11 03 06 AE 41 56 52 43 40 49 AD\n",
    b"[2026-11-21 10:45:00.123] TX: 11 03 00 6B 00 03 76 87\n[2026-11-21 10:45:00.150] RX: 11 83 02 C1 34\n",
    b"10:45:00.123 > 0x11,0x03,0x00,0x6b,0x00,0x03,0x76,0x87\r\n10:45:00.140 < \\x11\\x83\\x02\\xc1\\x34\r\n",
    b":1103006B00037E\r\n:110306AE41565243400B\r\n",
    b"00000000  11 03 00 6b 00 03 76 87  11 03 06 ae 41 56 52 43  |..k..v.....AVRC|\n00000010  40 49 ad\n",
    b"[11][03][00][6B][00][03][76][87]\n<11><83><02><C1><34>\nWaiting for a confirmation...\n",
    b'name,type,start_time,duration,data,error\n"Async Serial","data",0.0006,2.3e-05,0x11,\n'
    b'"Async Serial","data",0.001,2.3e-05,0x03,\n',
    b"Time [s],Value,Parity Error,Framing Error\n0.000602500000000,0x11,,\n0.0012,0x03,,\n0.0018,0x00,Error,\n",
    b"0001 0000 0006 11 03 00 6B 00 03\n17 3 0 107 0 3\n",
    "Запрос: 11 03 00 6B 00 03 76 87\nОтвет: 11 83 02 C1 34\n".encode("cp1251"),
    "11 03 00 6B".encode("utf-16"),
    b'{"format": "serial-chunks", "version": 1, "baud": 19200}\n{"t_ns": 5, "hex": "1103006b"}\n',
)


def _parse(data: bytes, chance: Random) -> None:
    from analyzer.paste import read, tree
    from analyzer.paste.model import Envelope
    from captures.text import encodings

    if encodings.is_binary(data):
        return
    envelope: Envelope = chance.choice(("auto", "auto", "rtu", "ascii", "tcp"))
    role: Literal["auto", "request", "response"] = chance.choice(("auto", "auto", "request", "response"))
    paste = read(encodings.decoded(data), envelope, role)
    if chance.random() < 0.5:
        tree(paste, colour=chance.random() < 0.5, values=chance.random() < 0.5)
    else:
        for _ in paste.to_json(noise=True):
            pass


def _hostile_capture(data: bytes, chance: Random) -> Capture:
    """These bytes as reads."""
    chunks, now, at = [], chance.choice((0, 10**18, TIME_LIMIT - 10**10)), 0
    while at < len(data):
        size = chance.choice((1, 2, 8, 30, 300, 4000))
        now = min(now + chance.choice((0, 1000, 10**6, 10**7, 10**9)), TIME_LIMIT - 1)
        piece = data[at : at + size]
        errors = (chance.randrange(len(piece)),) if chance.random() < 0.02 else ()
        chunks.append(Chunk(now, piece, chance.choice((0, 0, 0, 1)), Mark.NONE, errors))
        at += size
    line = chance.choice((LINE, LineSettings(), LineSettings(baud=300), LineSettings(baud=10**7, char_bits=10)))
    return Capture.of(line, chunks, timed=chance.random() < 0.8)


def _analyse(data: bytes, chance: Random) -> None:
    from analyzer.core import analyse

    for analysed in analyse(_hostile_capture(data, chance)):
        assert len(analysed.batch) >= 0


def _export(data: bytes, chance: Random) -> None:
    from analyzer.exports import ExportOptions, export
    from analyzer.exports import formats as written

    name = chance.choice(written())
    options = ExportOptions(noise=chance.random() < 0.5, explain=chance.random() < 0.5)
    out = folder() / f"out.{name}"
    export(_hostile_capture(data[:20_000], chance), out, name=name, options=options)
    if name == "mcap":
        again = captures.open(out)
        assert all(len(block) for block in again.blocks())
        assert not again.damage, again.damage[0]


def _report(data: bytes, chance: Random) -> None:
    from analyzer.checks import compile_check, run

    run(_hostile_capture(data[:20_000], chance), [compile_check(chance.choice(rules()).decode(), LINE)])


def _bytes() -> Sequence[bytes]:
    chance = Random(1)
    return [b"".join(chunk.data for chunk in conversation(chance, count)) for count in (1, 5, 40, 400)]


def targets() -> dict[str, Target]:
    """All of them by name: a reader for each format that there is."""
    from analyzer.exports import ExportError
    from analyzer.filters import FilterError
    from analyzer.paste import PasteError
    from attack.lakefiles import lake_targets
    from attack.languages import language_targets
    from attack.mapfiles import map_targets
    from attack.states import state_targets

    readers = [
        Target(f"reader {name}", cache(partial(_capture_seeds, name)), _read(name), (CaptureError,), TEXTS[:1])
        for name in formats()
    ]
    others = [
        Target("text", lambda: TEXTS, _parse, (PasteError, HexError), (b"11 83 02 C1 34", b" TX: ", b"0x", b":11"), 30),
        Target("text lines", lambda: TEXTS, _parse, (PasteError, HexError), share=30, make=log_lines),
        Target("analysis", cache(_bytes), _analyse, share=1, seconds=10.0),
        Target("exporters", cache(_bytes), _export, (ExportError,), share=1, seconds=10.0),
        Target("report", cache(_bytes), _report, (FilterError,), share=1, seconds=10.0),
    ]
    made = (*language_targets(), *map_targets(), *lake_targets(), *state_targets())
    return {target.name: target for target in (*readers, *others, *made)}
