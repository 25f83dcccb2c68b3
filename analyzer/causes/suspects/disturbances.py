"""What the line itself suffers, whoever sends: reflections, no bias, interference."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import log2
from typing import Any, Final

import numpy as np

from ...tables.findings import Severity
from ..bits import likelihood_bits, phase_bits, surplus_bits
from ..evidence import HEALTHY, Evidence, kind_bits, share_of
from ..exchanges import Ending
from ..registry import Explained, Suspicion, Symptom, suspect
from ..signatures import AnswerDamage, Behind

_LEAST: Final = 5
_LOAD: Final = 0.4  # where nobody knows it
_WELL: Final = 0.03  # of stray bytes that hit frames all the same, on a line that floats when nobody drives it
_ONE_UNIT: Final = 0.9  # of all stretches
_MOST: Final = 0.6
_FEW: Final = 0.15  # frames hit for a stretch on the idle line
_EARLY: Final = (0.3, 0.22, 0.16, 0.12, 0.08, 0.05, 0.04, 0.03)  # bits of a byte that ringing behind its start reaches
_UNIT_BITS: Final = 6.0  # each unit more that is said to be far
_SURE_BITS: Final = 14.0  # that a phase, a state or hours must add
_MAINS: Final = ((50.0, 0.15), (60.0, 0.18))  # Hz, and how far it strays
_PHASE_NS: Final = 1_500_000  # by which a time may be wrong for its phase to be known
_SWITCH_BITS: Final = 9.0  # a change between quiet and disturbed, one of 256 parts
_ROUNDS: Final = 6
_ALIKE: Final = {"bits": 0.24, "bits-tail": 0.03, "head": 0.12, "middle": 0.2, "whole": 0.13, "long": 0.06, "tail": 0.03,
                 "cut": 0.08, "cut-short": 0.05, "crossed": 0.02, "convention": 0.001, "count": 0.002, "other": 0.01}  # fmt: skip


def _all_explained(evidence: Evidence) -> Explained:
    kinds = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.MARKS, Symptom.SILENCE, Symptom.LATENESS)
    found = {(kind, unit.unit) for unit in evidence.units for kind in kinds}
    return frozenset(found | {(Symptom.FRAMING, None)})


class Hits:
    """How many exchanges were hit: frames (answers, requests) and the idle line."""

    def __init__(self, evidence: Evidence) -> None:
        self.damaged = sum(map(evidence.damaged, evidence.units))
        self.requests = sum(evidence.behind(unit, Behind.REQUEST) for unit in evidence.units)
        self.idle = sum(evidence.behind(unit, Behind.NOISE, Behind.ZEROS) for unit in evidence.units)
        self.exchanges = sum(unit.asked for unit in evidence.units)

    @property
    def frames(self) -> float:
        return self.damaged + self.requests

    @property
    def all(self) -> float:
        return self.frames + self.idle


def _place_bits(hits: Hits, on_frames: float) -> float:
    """How much likelier hits of frames and of the idle line are, so many of each, if this share should meet frames."""
    return likelihood_bits(hits.frames, hits.all, on_frames) - likelihood_bits(hits.frames, hits.all, 0.5)


def _load(evidence: Evidence) -> float:
    return min(max(evidence.load or _LOAD, 0.05), 0.93)


@suspect(
    "bias",
    Severity.WARNING,
    blame="line",
    text="Nothing holds the line when nobody drives it: {idle} stretches of stray bytes on the idle line, while "
    "{well} of {answers} frames are whole",
    share="{idle} stretches in {exchanges} exchanges, {damaged} damaged answers",
    deciding_test="Measure A against B on the idle line: under 200 mV it floats",
    remedy="Fit bias resistors (pull-up on B, pull-down on A, 390 to 650 ohm) at one place of the bus, or switch the "
    "master's on",
)
def bias(evidence: Evidence) -> Iterator[Suspicion]:
    """Noise between frames, and frames that are well."""
    hits = Hits(evidence)
    if hits.idle < _LEAST:
        return
    readings = [reading for unit in evidence.units for reading in evidence.readings(unit)]
    touched = hits.damaged * share_of(readings, "head")  # noise that runs into the beginning of an answer
    idle, frames = hits.idle + touched, hits.frames - touched
    bits = surplus_bits(idle, max(hits.exchanges, idle), HEALTHY)
    bits += likelihood_bits(frames, idle + frames, _WELL) - likelihood_bits(frames, idle + frames, 0.5)
    stray = [evidence.behind(unit, Behind.NOISE, Behind.ZEROS) for unit in evidence.units]
    if len(stray) > 1 and max(stray) > _ONE_UNIT * sum(stray):
        bits /= 4  # a line that floats does so behind everybody
    explains = frozenset((Symptom.BEHIND, unit.unit) for unit in evidence.units) | {(Symptom.FRAMING, None)}
    if touched > _MOST * hits.damaged or hits.damaged < _FEW * idle:
        explains |= frozenset((Symptom.DAMAGE, unit.unit) for unit in evidence.units)
    yield Suspicion((), bits, explains, _numbers(hits), **_span(evidence))


def _numbers(hits: Hits) -> dict[str, Any]:
    return {
        "idle": round(hits.idle),
        "damaged": hits.damaged,
        "requests": round(hits.requests),
        "exchanges": hits.exchanges,
        "answers": hits.exchanges,
        "well": hits.exchanges - hits.damaged,
        "hits": round(hits.all),
    }


def _span(evidence: Evidence) -> dict[str, Any]:
    grid = evidence.ledger.grid
    parts = np.flatnonzero(grid.counts("damage"))
    if grid.begin is None or not len(parts):
        return {}
    return {"since": grid.begin + int(parts[0]) * grid.width, "until": _end(evidence, int(parts[-1]) + 1)}


def _end(evidence: Evidence, part: int) -> int:
    """The end of so many parts of the grid, which may reach beyond the capture's."""
    grid, ledger = evidence.ledger.grid, evidence.ledger
    reach = (grid.begin or 0) + part * grid.width
    return min(reach, ledger.end) if ledger.timed else reach


@suspect(
    "termination",
    Severity.ERROR,
    blame="line",
    text="Answers of units {list} come with flipped bits ({damaged} of {answers}), requests and other units' answers do "
    "not: reflections on the way from there{early}",
    share="{damaged} of {answers} answers of units {list}, {others_damaged} of {others_answers} of others",
    deciding_test="Put 120 ohm across A and B at the far end, or halve the baud rate: the errors must go",
    remedy="Terminate both ends of the cable with 120 ohm, and nowhere else; shorten stubs; avoid stars",
)
def termination(evidence: Evidence) -> Iterator[Suspicion]:
    """Bit errors in the frames of some units."""
    ranked = sorted(
        (unit for unit in evidence.units if evidence.damaged(unit) >= 2 and evidence.readings(unit)),
        key=lambda unit: -evidence.damaged(unit) / unit.asked,
    )
    best: Suspicion | None = None
    for count in range(1, min(len(ranked), max(1, (2 * len(evidence.units)) // 3)) + 1):
        far = ranked[:count]
        rest = [unit for unit in evidence.units if unit not in far]
        hits, trials = sum(map(evidence.damaged, rest)), sum(unit.asked for unit in rest)
        background = max(HEALTHY, (hits + 0.5) / (trials + 50))
        readings = [reading for unit in far for reading in evidence.readings(unit)]
        flips = [bit for reading in readings for bit in reading.flips]
        early = sum(log2(8 * _EARLY[bit]) for bit in flips)
        bits = sum(surplus_bits(evidence.damaged(unit), unit.asked, background) for unit in far)
        expected = {"bits": 0.52, "head": 0.17, "bits-tail": 0.04, "middle": 0.1, "whole": 0.12, "tail": 0.02}
        bits += kind_bits(readings, expected) + early - _UNIT_BITS * (count - 1)
        if share_of(readings, "bits", "bits-tail") < 0.3 or len(readings) < _LEAST:
            continue
        if best is None or bits > best.bits:
            costs = [evidence.cost(unit, Ending.GARBAGE) for unit in far]
            known = [ms for _, ms in costs if ms is not None]
            best = Suspicion(
                tuple(unit.unit for unit in far),
                bits,
                frozenset((Symptom.DAMAGE, unit.unit) for unit in far),
                {
                    "list": ", ".join(str(unit.unit) for unit in far),
                    "damaged": sum(map(evidence.damaged, far)),
                    "answers": sum(unit.asked for unit in far),
                    "others_damaged": hits,
                    "others_answers": trials,
                    "early": ", in the first bits behind an edge" if early > 8 else "",
                },
                lost_answers=sum(lost for lost, _ in costs),
                lost_ms=round(sum(known), 3) if known else None,
                frames=tuple(i for unit in far for i in unit.examples.get(Ending.GARBAGE, []))[:6],
                **_span(evidence),
            )
    if best is not None:
        yield best


def _anywhere(evidence: Evidence) -> tuple[Hits, float]:
    """Hits of all senders alike, and their weight."""
    hits = Hits(evidence)
    if hits.frames < _LEAST or hits.all < _LEAST:
        return hits, 0.0
    bits = surplus_bits(hits.all, max(hits.exchanges, hits.all), HEALTHY) + _place_bits(hits, _load(evidence))
    readings = [reading for unit in evidence.units for reading in evidence.readings(unit)]
    return hits, bits + min(kind_bits(readings, _ALIKE), 0.0)


def _suspicion(evidence: Evidence, hits: Hits, bits: float, more: Mapping[str, Any], **times: Any) -> Suspicion:
    costs = [evidence.cost(unit, Ending.GARBAGE) for unit in evidence.units]
    known = [ms for _, ms in costs if ms is not None]
    frames = tuple(i for unit in evidence.units for i in unit.examples.get(Ending.GARBAGE, []))[:6]
    return Suspicion(
        (),
        bits,
        _all_explained(evidence),
        {**_numbers(hits), **more},
        lost_answers=sum(lost for lost, _ in costs),
        lost_ms=round(sum(known), 3) if known else None,
        frames=frames,
        **{**_span(evidence), **times},
    )


_SHARE: Final = "{hits} hits in {exchanges} exchanges: {damaged} answers, {requests} requests, {idle} on the idle line"


@suspect(
    "bad-drop",
    Severity.ERROR,
    blame="line",
    text="Answers of unit {list} are damaged ({damaged} of {answers}), in no particular way; those of others are not",
    share="{damaged} of {answers} answers of unit {list}, {others_damaged} of {others_answers} of others",
    deciding_test="Swap the drops of unit {list} and a good one: does the damage stay with the unit or with the drop?",
    remedy="Check the terminals, the stub and the shield of this drop, then the unit's line driver",
)
def bad_drop(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage of any kind, of one unit alone."""
    for unit in evidence.units if len(evidence.units) > 1 else ():
        bits = evidence.surplus(unit) + min(kind_bits(evidence.readings(unit), _ALIKE), 0.0) - _UNIT_BITS
        if bits > 0 and evidence.damaged(unit) >= _LEAST:
            others = [other for other in evidence.units if other.unit != unit.unit]
            lost, lost_ms = evidence.cost(unit, Ending.GARBAGE)
            yield Suspicion(
                (unit.unit,),
                bits,
                frozenset({(Symptom.DAMAGE, unit.unit)}),
                {
                    "list": unit.unit,
                    "damaged": evidence.damaged(unit),
                    "answers": unit.asked,
                    "others_damaged": sum(map(evidence.damaged, others)),
                    "others_answers": sum(other.asked for other in others),
                },
                lost_answers=lost,
                lost_ms=lost_ms,
                frames=tuple(unit.examples.get(Ending.GARBAGE, [])),
                **_span(evidence),
            )


@suspect(
    "interference",
    Severity.ERROR,
    blame="line",
    text="Something disturbs the line, whoever sends: {damaged} answers and about {requests} requests of {exchanges} "
    "exchanges are damaged, at no place and no time in particular",
    share=_SHARE,
    deciding_test="Halve the baud rate: if the share of damaged frames falls, spikes are the cause and not the wiring",
    remedy="Check shield (earthed at one end), common wire, loose terminals, and cables that run beside power cables",
)
def interference(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage of all senders alike."""
    hits, bits = _anywhere(evidence)
    if bits > 0:
        yield _suspicion(evidence, hits, bits, {})


@suspect(
    "emi-mains",
    Severity.ERROR,
    blame="line",
    text="Interference in step with the mains: {hits} hits, {alike:.0%} of them at one phase of {frequency:.2f} Hz",
    share=_SHARE,
    deciding_test="Look at A against B with an oscilloscope triggered by the mains",
    remedy="Look for thyristors, dimmers, welding or a soft starter on the same supply; separate the bus cable from power "
    "cables, earth the shield, use an isolated converter",
)
def emi_mains(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage at one phase of the mains or of its half-waves."""
    hits, bits = _anywhere(evidence)
    if bits <= 0 or not evidence.ledger.timed or evidence.verdict.wait_ns > _PHASE_NS:
        return
    times = _times_of_hits(evidence)
    if len(times) < _LEAST:
        return
    span = evidence.ledger.span_ns / 1e9
    for mains, strays in _MAINS:
        for per_wave in (1, 2):
            found, frequency, length = phase_bits(times, per_wave * (mains - strays), per_wave * (mains + strays), span)
            if found >= _SURE_BITS:
                numbers = {"frequency": frequency / per_wave, "alike": length}
                yield _suspicion(evidence, hits, bits + found, numbers, period_s=round(1 / frequency, 6))


def _times_of_hits(evidence: Evidence) -> np.ndarray[Any, np.dtype[np.float64]]:
    """When damage struck, s, as far as its place is known."""
    times: list[int] = []
    for unit in evidence.units:
        for reading in evidence.readings(unit):
            if reading.damage is AnswerDamage.BITS and reading.t_ns >= 0:
                times.append(reading.t_ns)
    return np.concatenate((np.array(times, np.float64), evidence.ledger.stray_times.numbers)) / 1e9


@suspect(
    "emi-drive",
    Severity.ERROR,
    blame="line",
    text="The line is disturbed while {what} of unit {unit} is {value}: {then} of {then_of} exchanges are hit then, {else_} of "
    "{else_of} otherwise",
    share=_SHARE,
    deciding_test="Switch what this value stands for off and on by hand, and watch the damaged frames",
    remedy="Lead the bus cable away from the motor cable of this drive; earth the drive's shield on both sides, fit a filter "
    "or a ferrite at its output",
)
def emi_drive(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage that goes with a value on the bus."""
    hits, bits = _anywhere(evidence)
    state = evidence.ledger.states.likeliest()
    if bits <= 0 or state is None or state.bits < _SURE_BITS:
        return
    area = {1: "coil", 2: "discrete input", 3: "holding register", 4: "input register"}[state.function]
    numbers = {
        "what": f"{area} {state.address}",
        "unit": state.unit,
        "value": state.value,
        "then": state.hits,
        "then_of": state.trials,
        "else_": state.other_hits,
        "else_of": state.other_trials,
    }
    yield _suspicion(evidence, hits, bits + state.bits, numbers)


@suspect(
    "hours",
    Severity.ERROR,
    blame="line",
    text="Interference at certain times: {inside} of {hits} hits fall into {spells} spells that make up {part:.0%} of the "
    "time",
    share=_SHARE,
    deciding_test="Ask what runs in the plant at these times, and record over a week",
    remedy="Find the machine that runs then (shift, pump, charger, lighting) and keep the bus cable away from its cables",
)
def hours(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage in spells."""
    hits, bits = _anywhere(evidence)
    if bits <= 0 or not evidence.ledger.timed:
        return
    grid = evidence.ledger.grid
    found, inside = spells_of(grid.counts("damage"), grid.counts("asked"))
    if found < _SURE_BITS or grid.begin is None:
        return
    edges = np.flatnonzero(np.diff(np.concatenate(([0], inside.astype(np.int8), [0]))))
    begins, ends = edges[::2], edges[1::2]
    counts, trials = grid.counts("damage"), grid.counts("asked")
    numbers = {
        "spells": len(begins),
        "inside": int(counts[inside].sum()),
        "hits": int(counts.sum()),
        "part": float(inside[trials > 0].mean()),
    }
    times: dict[str, Any] = {
        "since": grid.begin + int(begins[0]) * grid.width,
        "until": _end(evidence, int(ends[-1])),
    }
    if len(begins) > 2:
        times["period_s"] = round(float(np.diff(begins).mean()) * grid.width / 1e9, 1)
    yield _suspicion(evidence, hits, bits + found, numbers, **times)


def spells_of(
    hits: np.ndarray[Any, np.dtype[np.int64]], trials: np.ndarray[Any, np.dtype[np.int64]]
) -> tuple[float, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Parts of the time that are disturbed, by the most likely course of quiet and disturbed; and what it saves in bits.

    Two rates and a price for each change, refined in turns (hard EM).
    """
    trials = np.maximum(trials, hits)
    used = np.flatnonzero(trials > 0)
    inside = np.zeros(len(hits), np.bool_)
    h, n = hits[used].astype(float), trials[used].astype(float)
    if len(used) < 4 or not h.sum():
        return 0.0, inside
    rate = h.sum() / n.sum()
    quiet, loud = rate / 4, min(rate * 2.5, 0.9)
    one = likelihood_bits(float(h.sum()), float(n.sum()), rate)
    path, best = np.zeros(len(used), np.bool_), -np.inf
    for _ in range(_ROUNDS):
        path, best = _course(h, n, quiet, loud)
        if not path.any() or path.all():
            return 0.0, inside
        quiet = max((h[~path].sum() + 0.25) / (n[~path].sum() + 0.5), 1e-6)
        loud = (h[path].sum() + 0.25) / (n[path].sum() + 0.5)
    inside[used] = path
    return float(best - one - log2(max(n.sum(), 2))), inside


def _course(
    h: np.ndarray[Any, Any], n: np.ndarray[Any, Any], quiet: float, loud: float
) -> tuple[np.ndarray[Any, np.dtype[np.bool_]], float]:
    """Viterbi over two states."""
    gains = [h * log2(rate) + (n - h) * log2(1 - rate) for rate in (quiet, min(loud, 1 - 1e-6))]
    scores, back = [gains[0][0], gains[1][0] - _SWITCH_BITS], []
    for i in range(1, len(h)):
        came = [0 if scores[0] >= scores[1] - _SWITCH_BITS else 1, 1 if scores[1] >= scores[0] - _SWITCH_BITS else 0]
        scores = [
            gains[state][i] + scores[came[state]] - (_SWITCH_BITS if came[state] != state else 0.0) for state in (0, 1)
        ]
        back.append(came)
    state = int(scores[1] > scores[0])
    best = max(scores)
    path = [state]
    for came in reversed(back):
        state = came[state]
        path.append(state)
    return np.array(path[::-1], np.bool_), float(best)
