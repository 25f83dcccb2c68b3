"""What inputs are fed to, and what it may raise: the errors that a user is told in a line, and no other."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Final, Literal

import numpy as np

import captures
from attack.seedfiles import repacked, seeds_of
from captures import Capture, CaptureError, Chunk, LineSettings, Mark
from captures.chunks import TIME_LIMIT
from captures.formats import formats
from captures.text.halves import HexError

_ZIPPED: Final = ("sigrok", "saleae-session")
LINE: Final = LineSettings(baud=19200, char_bits=11, parity="E", tap="irq")
_FRAMES: Final = (
    "1103006b00037687",
    "110306ae415652434049ad",
    "118302c134",
    "0b0100130025",
    "110105cd6bb20e1b45e6",
    "110500acff004e8b",
    "11100001000204000a0102c6f0",
    "0006000100039a1a",
    "112b0e01003f44",
    "011700030006000e00030600ff00ff00ff",
)
FRAMES: Final = tuple(bytes.fromhex(text) for text in _FRAMES)


@dataclass(frozen=True)
class Target:
    """`take` gets an input, with chances of its own; `errors` are what a user is told. `share` of all inputs.

    `seconds` of CPU is the most that an input may take.
    """

    name: str
    seeds: Callable[[], Sequence[bytes]]
    take: Callable[[bytes, Random], None]
    errors: tuple[type[Exception], ...] = ()
    tokens: tuple[bytes, ...] = ()
    share: int = 10
    seconds: float = 1.0


@cache
def folder() -> Path:
    """Where files are for a moment: in memory, where there is such a place."""
    memory = Path("/dev/shm")
    return Path(tempfile.mkdtemp(dir=memory if os.access(memory, os.W_OK) else None))


def conversation(chance: Random, count: int = 20) -> list[Chunk]:
    """Frames with times, ports and marks, not all of them sensible."""
    wild, now, chunks = chance.random() < 0.1, chance.choice((0, 10**18, -(10**15))), []
    for _ in range(count):
        now += chance.choice((1, 10**6, 10**7, 3 * 10**9))
        t_ns = chance.choice((now, 1 - TIME_LIMIT, TIME_LIMIT - 1, 0)) if wild else now
        data = chance.choice((*FRAMES, chance.randbytes(chance.randint(1, 40))))
        errors = (chance.randrange(len(data)),) if chance.random() < 0.1 else ()
        chunks.append(Chunk(t_ns, data, chance.choice((0, 0, 1)), chance.choice(tuple(Mark)), errors))
    return chunks


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
    from analyzer.paste.mixing import Envelope
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


_WORDS: Final = (
    b" and ",
    b" or ",
    b"not ",
    b"(",
    b")",
    b" in ",
    b"..",
    b" ms",
    b" chars",
    b" unit ",
    b" where ",
    b":",
    b"17",
    b"%",
)
_RULES_FILES: Final = (
    b'[[rule]]\nname = "x"\ncheck = "no crc errors"\nseverity = "warning"\n',
    b'[[rule]]\ncheck = "every poll answered"\n[[rule]]\ncheck = "p95 response_time < 80 ms"\n',
)
_NOTES: Final = (
    b'{"version": 1, "bookmarks": [{"port": 0, "start": 5, "comment": "x"}], '
    b'"time_reference": {"port": 0, "start": 5}}',
)


@cache
def _filters() -> Sequence[bytes]:
    """The examples of the language's own reference, and some of them joined."""
    from analyzer.filters.fields import FIELDS

    examples = [field.example for field in FIELDS]
    joined = [f"({one} or not {two}) and {one}" for one, two in pairwise(examples)]
    return [text.encode() for text in (*examples, *joined)]


@cache
def _rules() -> Sequence[bytes]:
    from analyzer.checks.forms import forms

    return [example.encode() for form in forms() for example in form.examples]


@cache
def _table() -> object:
    from analyzer.core import analyse
    from analyzer.filters import BatchTable
    from captures.samples import path

    capture = captures.open(path("troubled.jsonl"))
    analysed = next(iter(analyse(capture)))
    return BatchTable(analysed.batch, capture.line, transactions=analysed.transactions)


def _filter(data: bytes, chance: Random) -> None:
    from analyzer.filters import check, compile_filter

    text = data.decode(errors="replace")[:5000]
    if chance.random() < 0.2:
        check(text, LineSettings())
    compiled = compile_filter(text, LINE)
    compiled.mask(_table())  # type: ignore[arg-type]


def _rule(data: bytes, chance: Random) -> None:
    from analyzer.checks import compile_check, run

    rule = compile_check(data.decode(errors="replace")[:5000], LINE)
    if chance.random() < 0.1:
        run(Capture.of(LINE, conversation(chance)), [rule])


def _rules_file(data: bytes, _: Random) -> None:
    from analyzer.checks import load_rules

    path = folder() / "rules.toml"
    path.write_bytes(data)
    load_rules(path, LINE)


def _beside(data: bytes, _: Random) -> None:
    from analyzer.usernotes import Notes

    path = folder() / "bus.mcap"
    path.with_name("bus.mcap.rtuscope.json").write_bytes(data)
    Notes.beside(path)


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

    run(_hostile_capture(data[:20_000], chance), [compile_check(chance.choice(_rules()).decode(), LINE)])


def _bytes() -> Sequence[bytes]:
    chance = Random(1)
    return [b"".join(chunk.data for chunk in conversation(chance, count)) for count in (1, 5, 40, 400)]


def targets() -> dict[str, Target]:
    """All of them by name: a reader for each format that there is."""
    from analyzer.checks.errors import CheckError
    from analyzer.checks.rulesfile import RulesFileError
    from analyzer.exports import ExportError
    from analyzer.filters import FilterError
    from analyzer.paste import PasteError
    from analyzer.usernotes import NotesError
    from attack.mapfiles import map_targets

    readers = [
        Target(f"reader {name}", cache(partial(_capture_seeds, name)), _read(name), (CaptureError,), TEXTS[:1])
        for name in formats()
    ]
    others = [
        Target("text", lambda: TEXTS, _parse, (PasteError, HexError), (b"11 83 02 C1 34", b" TX: ", b"0x", b":11"), 30),
        Target("filters", _filters, _filter, (FilterError,), _WORDS, 30),
        Target("rules", _rules, _rule, (CheckError, FilterError), _WORDS, 30),
        Target("rule files", lambda: _RULES_FILES, _rules_file, (RulesFileError,), _WORDS, 5),
        Target("notes beside", lambda: _NOTES, _beside, (NotesError,), share=5),
        Target("analysis", cache(_bytes), _analyse, share=1, seconds=10.0),
        Target("exporters", cache(_bytes), _export, (ExportError,), share=1, seconds=10.0),
        Target("report", cache(_bytes), _report, (FilterError,), share=1, seconds=10.0),
    ]
    return {target.name: target for target in (*readers, *others, *map_targets())}
