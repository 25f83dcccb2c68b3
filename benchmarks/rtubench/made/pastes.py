"""Texts as people paste them: logs of programs, dumps, arrays, with words around, for the track texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from random import Random

from ..items import Item, Row
from ..line import Client, Line, Sent, Unit
from ..modbus import Memory
from .buses import poll_list

_SIDES = (("TX", "RX"), ("Tx:", "Rx:"), (">>", "<<"), ("-->", "<--"), ("SEND", "RECV"), ("Request:", "Response:"))
Style = Callable[[Random, Sequence[Sent]], str]


def _spaced(data: bytes, form: str = "{:02X}", sign: str = " ") -> str:
    return sign.join(form.format(byte) for byte in data)


def _clock(ns: int, parts: str = "ms") -> str:
    seconds, rest = divmod(ns + 36_000 * 10**9, 10**9)
    told = f"{seconds // 3600 % 24:02}:{seconds // 60 % 60:02}:{seconds % 60:02}"
    return told + {"ms": f".{rest // 10**6:03}", "us": f".{rest // 1000:06}", "s": ""}[parts]


def arrows(random: Random, sent: Sequence[Sent]) -> str:
    """TX and RX before each line, or what stands for them."""
    out, back = random.choice(
        (("TX", "RX"), ("Tx:", "Rx:"), (">>", "<<"), ("-->", "<--"), ("SEND", "RECV"), ("Request:", "Response:"))
    )
    form = random.choice(("{:02X}", "{:02x}"))
    return "\n".join(f"{out if one.role == 'request' else back} {_spaced(one.line, form)}" for one in sent)


def stamped(random: Random, sent: Sequence[Sent]) -> str:
    """A time, a direction, bytes."""
    day = random.choice(("", "2026-03-17 ", "[17.03.2026] "))
    parts = random.choice(("ms", "us", "s"))
    return "\n".join(f"{day}{_clock(one.t_ns, parts)} {'Tx' if one.role == 'request' else 'Rx'}: {_spaced(one.line)}"
                     for one in sent)  # fmt: skip


def debug(random: Random, sent: Sequence[Sent]) -> str:
    """A program's debug log, with its level and module, bytes as 0x numbers."""
    out, back = random.choice((("sending", "received"), ("SEND:", "RECV:"), ("send frame", "recv frame")))
    head = random.choice(("DEBUG modbus.rtu:", "[DEBUG] (port0)", "D/Serial:"))
    return "\n".join(f"{_clock(one.t_ns)} {head} {out if one.role == 'request' else back} "
                     f"{_spaced(one.line, '0x{:02x}')}" for one in sent)  # fmt: skip


def brackets(_: Random, sent: Sequence[Sent]) -> str:
    """Each byte in brackets of its side."""
    sides = {"request": "[{:02X}]", "response": "<{:02X}>"}
    return "\n".join(_spaced(one.line, sides[one.role], "") for one in sent)


def solid(random: Random, sent: Sequence[Sent]) -> str:
    """Hexadecimal digits without spaces, numbered."""
    sign = random.choice((": ", ") ", "\t"))
    return "\n".join(f"{at}{sign}{one.line.hex()}" for at, one in enumerate(sent, 1))


def array(_: Random, sent: Sequence[Sent]) -> str:
    """Arrays of a program in C."""
    names = {"request": "tx", "response": "rx"}
    return "\n".join(f"uint8_t {names[one.role]}{at}[] = {{{_spaced(one.line, '0x{:02X}', ', ')}}};"
                     for at, one in enumerate(sent))  # fmt: skip


def escaped(_: Random, sent: Sequence[Sent]) -> str:
    """Bytes as Python prints them, each with a backslash."""
    names = {"request": "write", "response": "read"}
    return "\n".join(f"{names[one.role]}: b'{_spaced(one.line, chr(92) + 'x{:02x}', '')}'" for one in sent)


def decimals(_: Random, sent: Sequence[Sent]) -> str:
    """Lists of decimal numbers."""
    names = {"request": "sent", "response": "got"}
    return "\n".join(f"{names[one.role]} [{_spaced(one.line, '{}', ', ')}]" for one in sent)


def dump(_: Random, sent: Sequence[Sent]) -> str:
    """A dump in rows of sixteen with offsets and characters."""
    data = b"".join(one.line for one in sent)
    rows = []
    for at in range(0, len(data), 16):
        row = data[at : at + 16]
        shown = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in row)
        rows.append(f"{at:08x}  {_spaced(row[:8], '{:02x}'):23}  {_spaced(row[8:], '{:02x}'):23}  |{shown}|")
    return "\n".join(rows)


def table(_: Random, sent: Sequence[Sent]) -> str:
    """A Markdown table."""
    rows = [f"| {at} | {_clock(one.t_ns)} | {'M->S' if one.role == 'request' else 'S->M'} | `{_spaced(one.line)}` |"
            for at, one in enumerate(sent, 1)]  # fmt: skip
    return "\n".join(("| # | time | dir | data |", "|---|---|---|---|", *rows))


def prose(random: Random, sent: Sequence[Sent]) -> str:
    """Frames within sentences."""
    says = {"request": ("I send {}", "Then the master asks {}", "My PLC sends: {}"),
            "response": ("and the meter answers {}", "I get back {}", "the reply is {}")}  # fmt: skip
    return "\n".join(random.choice(says[one.role]).format(_spaced(one.line)) + "." for one in sent[:6])


STYLES: dict[str, Style] = {one.__name__: one for one in (
    arrows, stamped, debug, brackets, solid, array, escaped, decimals, dump, table, prose)}  # fmt: skip
_BEFORE = ("", "", "Hi all,\nmy meter does not answer as it should, 9600 8N1. Here is the log:\n\n",
           "Device: EM340, address see below, firmware 2.14\n```\n", "Ich bekomme folgende Antwort:\n\n")  # fmt: skip
_AFTER = ("", "", "\n\nAny idea? I have 120 ohm at both ends.", "\n```\n", "\n\nThanks in advance, J.")


def _strangers(random: Random) -> dict[str, str]:
    """Texts with bytes that are no Modbus."""

    def mac() -> str:
        return ":".join(f"{random.randrange(256):02x}" for _ in range(6))

    return {
        "addresses": "\n".join(f"eth{at}: link/ether {mac()} brd ff:ff:ff:ff:ff:ff" for at in range(6)),
        "sentences": "\n".join(
            f"$GPGGA,1235{at:02},4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47" for at in range(6)
        ),
    }


def items(seed: int, each: int) -> Iterator[Item]:
    """`each` texts of every style, and two of other things."""
    for name, style in STYLES.items():
        for number in range(each):
            random = Random(f"{seed} {name} {number}")
            line = Line(random, baud=9600)
            units = random.sample(range(1, 40), 2)
            line.units = {unit: Unit(unit, Memory.drawn(random)) for unit in units}
            sent = line.run([Client(poll_list(random, units, (1, 3, 3, 4), (5, 6, 16)))], random.randint(4, 10))
            sent = sent[: len(sent) - (sent[-1].role == "request")]
            text = style(random, sent)
            shown = sent[:6] if style is prose else sent
            frames: list[Row] = [{"hex": one.line.hex(), "direction": one.role} for one in shown]
            around = random.choice(_BEFORE), random.choice(_AFTER)
            yield Item(
                f"{name}-{number}", "text", "made", ("texts",), {"frames": frames}, text=text.join(around) + "\n"
            )
    for name, text in _strangers(Random(seed)).items():
        yield Item(name, "text", "made", ("texts",), {"frames": []}, text=text + "\n")
