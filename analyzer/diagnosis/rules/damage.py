"""Frames whose check value is wrong: what happened to them, by their autopsy (`analyzer.diagnosis.damage.triage`).

Bytes that the UART marked are said as such, with what the autopsy of the frame adds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import nan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.crc import VARIANTS, crc16

from ...languages import counted, phrase
from ...tables.batch import adu_of
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import Kind, Protocol, Row, Rows
from ...tables.taps import TapKind, tap_kind
from ..damage import DividedFrame, Explanation
from ..damage.triage import VAGUE, lacks_first
from ..view import DiagnosisStep, where
from .outcomes import ECHO

_NOISY_LINE: Final = "interference, missing or double termination, a loose terminal, or two drivers at once"
_LINE: Final = "check termination at both ends, shield and common; lower the baud rate to see whether it helps"


def _positions(numbers: Mapping[str, float]) -> str:
    """Where a byte is missing or too many, with the places that fit as well."""
    ranges = []
    for first, last in (("first", "last"), ("second_first", "second_last")):
        if first in numbers:
            low, high = int(numbers[first]), int(numbers[last])
            ranges.append(f"{low}" if low == high else phrase("{low} to {high}", low=low, high=high))
    others = int(numbers["places"]) - len(ranges)
    more = phrase(" or one of {others} more places", others=others) if others > 0 else ""
    return phrase(" or ").join(ranges) + more


def _byte_at(english: str, numbers: Mapping[str, float]) -> str:
    return phrase(english, value=f"{int(numbers['value']):02X}", places=_positions(numbers))


def _by(number: str, words: str, words_of_zero: str) -> Callable[[Mapping[str, float]], str]:
    """Words for a finding, and others where this number of its evidence is 0."""

    def told(numbers: Mapping[str, float]) -> str:
        checks = {name: _crc(numbers, name) for name in numbers.keys() & {"received", "computed"}}
        return phrase(words if numbers[number] else words_of_zero, **checks)

    return told


BIT_FLIP: Final = Rule(
    "bit-flip",
    Severity.ERROR,
    About.FRAME,
    when="one flipped bit makes the CRC match; the syndrome names the bit",
    clause="[2] 2.5.1.2",
    numbers=("byte", "bit", "certainty", "unit"),
    loses=True,
    text="one bit is flipped: byte {byte:.0f}, bit {bit:.0f} (bit 0 = LSB); flipping it back makes the CRC match",
    cause=_NOISY_LINE,
    remedy=_LINE,
)
MISSING: Final = Rule(
    "byte-missing",
    Severity.ERROR,
    About.FRAME,
    when="the frame is one byte short, and adding a byte makes length and CRC match",
    clause="[2] 2.5.1.2",
    numbers=("first", "last", "value", "places", "certainty", "second_first", "second_last", "unit"),
    loses=True,
    text=partial(_byte_at, "a byte is missing: with {value} as byte {places} the CRC matches"),
    cause=_by(
        "first",
        "the receiver lost a byte: its buffer ran over, or its processor was busy; or the line was disturbed",
        "the sender's driver was enabled too late, or the receiver too late after its own request; a text may leave "
        "out the unit's byte",
    ),
    remedy=_by(
        "first",
        "find out which receiver loses it, the tap's or the device's (use a logic analyser); otherwise check the line",
        "check the driver-enable timing of the sender and of the receiver; see whether the text shows the unit "
        "elsewhere",
    ),
)
EXTRA: Final = Rule(
    "byte-extra",
    Severity.ERROR,
    About.FRAME,
    when="the frame is one byte too long, and removing a byte makes length and CRC match",
    clause="[2] 2.5.1.2",
    numbers=("first", "last", "value", "places", "certainty", "second_first", "second_last", "unit"),
    loses=True,
    text=partial(_byte_at, "one byte too many: without {value} (byte {places}) the CRC matches"),
    cause="a pulse on the line was taken for a start bit, often while drivers switch",
    remedy="check bias resistors and termination, and the driver-enable timing of the sender",
)
TRUNCATED: Final = Rule(
    "truncated",
    Severity.ERROR,
    About.FRAME,
    when="a frame begins like one of a known length and ends early",
    clause="[2] 2.5.1.1",
    numbers=("bytes", "due", "certainty", "unit"),
    loses=True,
    text=lambda numbers: (
        phrase(
            "the frame begins like one of {due} and ends after {bytes}",
            bytes=_bytes(numbers["bytes"]),
            due=_bytes(numbers["due"]),
        )
        if "due" in numbers
        else phrase("the frame begins like one and ends after {bytes}", bytes=_bytes(numbers["bytes"]))
    ),
    cause="the sender's driver is switched off too early, or its buffer is too short; or the tap lost the end",
    remedy="check the sender's driver-enable timing; ask for fewer registers and see whether it helps",
)
VARIANT: Final = Rule(
    "crc-variant",
    Severity.ERROR,
    About.FRAME,
    when="the check value is correct under another convention",
    clause="[2] 6.2.2",
    numbers=("variant", "certainty", "unit"),
    varies="variant",
    loses=True,
    text=lambda numbers: phrase(
        "the check value is correct, but computed differently: {variant}",
        variant=VARIANTS[int(numbers["variant"])].name,
    ),
    cause="the sender's firmware computes or sends its check value wrongly",
    remedy="the specification requires CRC-16/MODBUS, least significant byte first: have the firmware corrected",
)
REPEATED: Final = Rule(
    "bytes-repeated",
    Severity.ERROR,
    About.FRAME,
    when="removing a repeated part makes the frame's CRC match",
    numbers=("byte", "length", "certainty", "unit"),
    loses=True,
    text=lambda numbers: phrase(
        "{bytes} from byte {byte:.0f} on appear twice; with one copy the CRC matches",
        numbers,
        bytes=_bytes(numbers["length"]),
    ),
    cause="a buffer bug in a converter or driver between the line and the receiver",
    remedy="update the converter's driver or firmware, or use another one",
)
FLOW: Final = Rule(
    "flow-control-loss",
    Severity.ERROR,
    About.FRAME,
    when="inserting bytes 11 or 13 (XON, XOFF) repairs the frames",
    numbers=("lost", "certainty", "unit"),
    loses=True,
    text=lambda numbers: phrase(
        "{bytes} of 11 or 13 (XON, XOFF) missing; with them back the CRC matches", bytes=_bytes(numbers["lost"])
    ),
    cause="the capturing port has software flow control on and swallows these bytes",
    remedy="switch XON/XOFF off on the port (stty -ixon -ixoff)",
)
COLLISION: Final = Rule(
    "collision",
    Severity.ERROR,
    About.FRAME,
    when="the bytes where an answer was due form no frame and fit no possible answer",
    clause="[2] 2.4.1",
    numbers=("bytes", "due", "certainty", "unit"),
    loses=True,
    text=lambda numbers: (
        phrase("{bytes} that form no frame instead of an answer", bytes=_bytes(numbers["bytes"]))
        + (phrase(" of {due:.0f}", numbers) if "due" in numbers else "")
    ),
    cause="two transmitters at once: a shared address, a second client, or a device that sends unprompted",
    remedy="disconnect devices one by one; look for duplicate addresses and a second client",
)
_PLACEHOLDERS: Final = (0, 0xFFFF)  # in the place of a check value that a program has yet to compute


CRC_ERROR: Final = Rule(
    "crc-error",
    Severity.ERROR,
    About.FRAME,
    when="the CRC is wrong and nothing more exact explains it",
    clause="[2] 2.5.1.2",
    numbers=("received", "computed", "unit", "placeholder"),
    varies="placeholder",
    loses=True,
    text=_by(
        "placeholder",
        "{received} stands where the CRC belongs ({computed})",
        "the CRC is wrong ({received} instead of {computed}), with no simple explanation",
    ),
    cause=_by("placeholder", "the sender has not computed a CRC: {received} keeps its place", _NOISY_LINE),
    remedy=_by("placeholder", "have the sender compute the CRC: {computed} ends this frame, low byte first", _LINE),
)


def _marked(numbers: Mapping[str, float]) -> str:
    words = phrase(
        "the UART marked {marked_bytes:.0f} of {bytes:.0f} bytes: wrong parity, or no stop bit where one was due",
        numbers,
    )
    if "verdict" not in numbers:
        return words
    rule = tuple(_RULES.values())[int(numbers["verdict"])]
    if rule is BIT_FLIP and "byte" in numbers:
        return words + phrase("; with bit {bit:.0f} of byte {byte:.0f} flipped back the CRC matches", numbers)
    return words + phrase("; the frame itself is {code}", code=rule.code)


PARITY: Final = Rule(
    "parity-error",
    Severity.ERROR,
    About.FRAME,
    when="the UART marked bytes of the frame for parity or framing",
    clause="[2] 2.5.1",
    numbers=("marked_bytes", "bytes", "unit", "verdict", "byte", "bit", "certainty"),
    loses=True,
    text=_marked,
    cause="the line is disturbed; if most frames are hit, baud rate or parity differs from the sender's",
    remedy="compare baud rate, parity and stop bits of tap and devices; then check the line",
)


LRC_ERROR: Final = Rule(
    "lrc-error",
    Severity.ERROR,
    About.FRAME,
    when="the LRC of a frame in ASCII mode is wrong",
    clause="[2] 2.5.2.2",
    numbers=("received", "computed"),
    loses=True,
    text=lambda numbers: (
        phrase(
            "the LRC is wrong ({received} instead of {computed})",
            **{name: f"{int(numbers[name]):02X}" for name in ("received", "computed")},
        )
        if "received" in numbers
        else phrase("the frame is too short to hold an LRC")
    ),
    cause=_NOISY_LINE,
    remedy=_LINE,
)


def _bytes(count: float) -> str:
    return counted(int(count), "byte", "bytes")


def _crc(numbers: Mapping[str, float], name: str) -> str:
    return int(numbers[name]).to_bytes(2, "little").hex(" ").upper()


_RULES: Final = {r.code: r for r in (BIT_FLIP, MISSING, EXTRA, TRUNCATED, VARIANT, REPEATED, FLOW, COLLISION, ECHO)}


@looks_for(LRC_ERROR)
def wrong_lrcs(view: DiagnosisStep) -> Iterator[Findings]:
    """Damaged frames of ASCII mode, which has no CRC to take them apart by."""
    for row in view.damaged[view.rows.protocol[view.damaged] == Protocol.ASCII].tolist():
        adu = adu_of(view.bytes_of(row), Protocol.ASCII)
        if not view.rows.errors[row]:
            values = (nan if value is None else value for value in (adu.check_received, adu.check_computed))
            yield LRC_ERROR.on(view.rows[row : row + 1], *values)


@looks_for(*_RULES.values(), CRC_ERROR, PARITY)
class DamagedRows:
    """Damaged frames, and the noise that was one; what is vague about the last row waits for the one behind it."""

    _waiting: list[Findings]
    _cut_by_end: bool

    def __init__(self) -> None:
        self._waiting = []
        self._cut_by_end = False  # what waits is the beginning of a frame

    @property
    def open_from(self) -> int | None:
        return int(self._waiting[0].index[0]) if self._waiting else None

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        rows = view.rows
        if not len(rows):
            return
        marked = where(view.rows.errors)
        if len(marked):
            yield _of_marked(view, marked)
        waiting, self._waiting, self._cut_by_end = self._waiting, [], False
        if 0 not in view.verdicts or view.verdicts[0][0].start >= 0:  # else its rest was still to come
            yield from waiting
        for row, parts in view.verdicts.items():
            findings = [finding for part in parts for finding in _findings_of(view, row, part)]
            first = row == 0 and not view.trail.newest.length[0] and tap_kind(view.line) is not TapKind.EXCERPT
            if first and lacks_first(parts[0].verdict):
                continue  # the capture begins inside it
            last = row == len(rows) - 1
            cut = last and _ends_early(parts)
            if cut or (last and parts[0].verdict.code in VAGUE):
                self._waiting, self._cut_by_end = findings, cut
            else:
                yield from findings

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:  # noqa: ARG002 - a look's signature
        """Nothing comes behind the last row; where the capture cut it short, nothing is wrong with it."""
        if not self._cut_by_end:
            yield from self._waiting


def _of_marked(view: DiagnosisStep, marked: NDArray[np.intp]) -> Findings:
    """What is said of rows with marked bytes; of those that came damaged with what their autopsy says."""
    rows = view.rows[marked]
    frames = (rows.kind > 0) & rows.check
    unit, more = np.where(frames, rows.unit, nan), np.full((len(rows), 4), nan)
    codes = list(_RULES)
    for i in where(~frames).tolist():
        row = int(marked[i])
        unit[i] = _owner(view, row, rows.row(i))
        verdict = view.verdicts[row][0].verdict if row in view.verdicts else None
        if verdict is not None and verdict.code in codes:
            sure = verdict.certainty
            more[i] = codes.index(verdict.code), _or_nan(verdict.byte), _or_nan(verdict.bit), sure
    return PARITY.on(rows, rows.errors, rows.length, unit, *more.T)


def _owner(view: DiagnosisStep, number: int, row: Row, verdict: Explanation | None = None) -> float:
    """The unit whose exchange a damaged row belongs to, row `number` or one right before it: that of the request it
    follows; NaN where nothing tells."""
    if row.kind == Kind.REQUEST:
        return float(verdict.repaired[0]) if verdict is not None and verdict.repaired else nan
    request = view.batch.request_of(number, row.request) if row.request >= 0 else None
    if request is not None:
        return float(request[0])
    for before in view.trail.back(view.batch, number):
        behind = before.row.port == row.port and before.row.start > row.start
        if before.is_frame and before.row.check and not behind:
            return float(before.row.unit) if before.row.kind == Kind.REQUEST and before.row.unit else nan
    return nan


def _ends_early(parts: Sequence[DividedFrame]) -> bool:
    """Whether a row is whole but for its end."""
    verdict = parts[-1].verdict
    if verdict.code == MISSING.code:
        return verdict.repaired is not None and verdict.places[0].last == len(verdict.repaired) - 1
    return verdict.code == TRUNCATED.code


def _findings_of(view: DiagnosisStep, number: int, part: DividedFrame) -> Iterator[Findings]:
    """The finding of one part of a row, or of a row and those before it."""
    row, data, verdict = view.rows[number : number + 1].copy(), view.bytes_of(number), part.verdict
    if row.errors[0]:
        return
    begins, start = view.rows.row(number), part.start
    for before in view.trail.back(view.batch, number):
        if start >= 0:
            break
        begins, start, data = before.row, start + before.row.length, before.captured + data
    row.index[:], row.t_start_ns[:] = begins.index, begins.t_start_ns
    data = data[max(start, 0) :][: part.length]
    row.start[:] += part.start
    row.length[:] = part.length
    if verdict.code == REPEATED.code and verdict.repaired and verdict.length == len(data):
        row = _with_the_frame_before(row, len(verdict.repaired), view, number)
    rule, unit = _RULES.get(verdict.code), _owner(view, number, begins, verdict)
    if rule is not None:
        yield rule.on(row, *_numbers(verdict, data), unit)
    else:
        computed, received = crc16(data[:-2]) if len(data) > 2 else 0, int.from_bytes(data[-2:], "little")
        yield CRC_ERROR.on(row, received, computed, unit, received in _PLACEHOLDERS)


def _with_the_frame_before(noise: Rows, length: int, view: DiagnosisStep, number: int) -> Rows:
    """A frame and the noise behind it as one row."""
    joined = noise.copy()
    joined.start[:] -= length
    joined.length[:] += length
    behind = view.frames[view.frames > number]
    joined.index[:] = view.rows.index[behind[0]] - 1 if len(behind) else view.rows.index.max()
    return joined


def _numbers(verdict: Explanation, data: bytes) -> tuple[float, ...]:
    """The evidence of a verdict, in the order of its rule's names."""
    sure = verdict.certainty
    match verdict.code:
        case "bit-flip":
            return _or_nan(verdict.byte), _or_nan(verdict.bit), sure
        case "byte-missing" | "byte-extra":
            first, *others = verdict.places
            second = others[0][:2] if others else (nan, nan)
            return first.first, first.last, first.value, len(verdict.places), sure, *second
        case "truncated" | "collision":
            return len(data), _or_nan(verdict.length), sure
        case "bytes-repeated":
            return _or_nan(verdict.byte), _or_nan(verdict.length), sure
        case "echo":
            return nan, _or_nan(verdict.lost), _or_nan(verdict.length), _or_nan(verdict.bit)
        case "flow-control-loss":
            return _or_nan(verdict.lost), sure
        case _:
            names = [variant.name for variant in VARIANTS]
            return names.index(verdict.variant or ""), sure


def _or_nan(number: int | None) -> float:
    return nan if number is None else number
