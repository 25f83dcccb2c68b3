"""What disturbs the line from outside, whoever sends: all the time, with the mains, with a drive, at certain hours."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from ...tables.findings import Severity
from ..bits import Phases, likelihood_bits, phase_bits, surplus_bits
from ..costs import cost_behind_damage, cost_of, kind_bits, overlaid, share_of, together
from ..evidence import HEALTHY, Evidence
from ..exchanges import Ending
from ..flatmemory import CrowdedTimes
from ..foretold import of_all
from ..hits import (
    ALIKE,
    WELL,
    Hits,
    apart_bits,
    end_of_part,
    evenness_bits,
    is_one_units,
    requests_evenness_bits,
    requests_part,
    span_of_hits,
    spares_requests,
    spares_units,
    spells_of_hits,
)
from ..registry import OF_A_LINE, Suspicion, Symptom, suspect
from ..signatures import AnswerDamage
from .common import examples

_LEAST: Final = 5
_SENT_INTO: Final = 0.35  # of the damaged answers
_FEW: Final = 0.1  # requests, for a damaged answer
_ON_FRAMES: Final = 0.05
_HALF: Final = 0.5
_HARDLY: Final = 2.0  # bits
_EDGES: Final = 0.02  # of the hits: what strikes close to a frame hits it as well
_IDLE_BITS: Final = 20.0
_OVERLAID: Final = 3.0  # bits for or against, of a damaged answer of quite another length
_SOME_OVERLAID: Final = 0.12  # of the damaged answers
_UNLIKE_BITS: Final = 100.0
_UNLIKE: Final = 0.1  # of what is in favour of it
_BY_TIME: Final = 1.0  # of what the times of hits are in favour of it: units are asked at other times
_LOAD: Final = 0.4  # where nobody knows it
_CONTRAST: Final = 8.0  # times as often the bus is hit while a value stands
_SWITCHES: Final = 4  # of it, at the least; and a spell, at most
_AS_WELL: Final = 0.7
_SURE_BITS: Final = 14.0  # that a phase or a state must add
_MAINS: Final = ((50.0, 0.15), (60.0, 0.18))  # Hz, and how far it strays
_OF_INTERFERENCE: Final = replace(OF_A_LINE, kind_of="interference")
_PHASE_NS: Final = 1_500_000  # by which a time may be wrong for its phase to be known


_TAKES: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.MARKS, Symptom.SILENCE, Symptom.LATENESS)


def _place_bits(hits: Hits, on_frames: float) -> float:
    """How much likelier hits of frames and of the idle line are, so many of each, if this share should meet frames.

    That fewer meet the idle line says little against it: a line at rest may be held better than a driven one.
    """
    bits = likelihood_bits(hits.frames, hits.all, on_frames) - likelihood_bits(hits.frames, hits.all, 0.5)
    return max(bits, -_IDLE_BITS) if hits.frames > on_frames * hits.all else bits


def _as_exposed(evidence: Evidence, hits: Hits) -> bool:
    """Whether some frames were hit, about as few as there are for as much on the idle line: that a line which floats
    when nobody drives it should do so is hardly likelier."""
    load = evidence.load
    if not hits.frames or load is None:
        return False
    for_all, for_idle = (likelihood_bits(hits.frames, hits.all, share) for share in (max(load, _EDGES), WELL))
    return for_all >= for_idle - _HARDLY


def _load(evidence: Evidence) -> float:
    return min(max(evidence.load or _LOAD, 0.05), 0.93)


class _Struck(NamedTuple):
    """What was hit, the weight of that, and of what does not go with it (bits)."""

    hits: Hits
    bits: float = 0.0
    against: float = 0.0


def _anywhere(evidence: Evidence, *, sparse: bool = False, by_time: float = 0.0) -> _Struck:
    """Hits of all senders alike, and their weight; `sparse`: where frames are rare, so may those be that are hit;
    `by_time`: bits by which it is told that they come and go, which are part of it."""
    hits = Hits(evidence)
    if not any(unit.answered for unit in evidence.units):
        return _Struck(hits)  # a line on which nothing is ever well is not disturbed
    if hits.all < _LEAST or (hits.frames < _LEAST and not (sparse and _as_exposed(evidence, hits))):
        return _Struck(hits)
    if (hits.requests < _FEW * hits.damaged and is_one_units(evidence)) or spares_requests(evidence, hits):
        return _Struck(hits)
    if spares_units(evidence):
        return _Struck(hits)
    bits = surplus_bits(hits.all, max(hits.exchanges, hits.all), HEALTHY) + _place_bits(hits, _load(evidence))
    readings = [reading for unit in evidence.units for reading in evidence.readings(unit)]
    if len(readings) >= _LEAST and share_of(readings, "crossed") > _SENT_INTO:
        return _Struck(hits)  # somebody sends into the answers
    if (
        hits.frames < min(_ON_FRAMES, _HALF * (evidence.load or 1)) * hits.all
    ):  # what hardly meets a frame would be on the idle line alone
        bits -= _IDLE_BITS
    bits += _OVERLAID * (_SOME_OVERLAID * len(readings) - overlaid(readings))
    bits -= surplus_bits(hits.requests, hits.frames, requests_part(evidence))  # nor does it look for who sends
    unlike = apart_bits(evidence) - evenness_bits(evidence) - requests_evenness_bits(evidence)
    if unlike > max(_UNLIKE_BITS, _UNLIKE * bits, _BY_TIME * by_time):
        return _Struck(hits)  # it spares some units: it is not everybody's
    return _Struck(hits, bits + by_time, max(-kind_bits(readings, ALIKE), 0.0) + unlike)


def _suspicion(evidence: Evidence, struck: _Struck, more: Mapping[str, Any], **times: Any) -> Suspicion:
    explains = of_all(evidence, _TAKES)
    lost = together((cost_of(evidence, explains), *(cost_behind_damage(evidence, unit) for unit in evidence.units)))
    frames = examples(evidence.units, Ending.GARBAGE)
    return Suspicion(
        (),
        struck.bits,
        explains,
        {**struck.hits.numbers, **more},
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=frames,
        against=struck.against,
        **{**span_of_hits(evidence), **times},
    )


_SHARE: Final = (
    "{hits:,} hits in {exchanges:,} exchanges: {damaged:answer|answers}[, {requests:request|requests}][, "
    "{idle} on the idle line]"
)


@suspect(
    "interference",
    Severity.ERROR,
    blame="line",
    text="Interference on the line, whoever transmits: {damaged:answer|answers}[ and about "
    "{requests:request|requests}] of "
    "{exchanges:,} exchanges are damaged, at no particular place or time",
    share=_SHARE,
    deciding_test="Look at the shield and at loose terminals first; then connect the client and a unit or two by a "
    "short cable of their own: if the damage goes, it comes from the bus cable and what is near it",
    remedy="Check shield (earthed at one end), common wire, loose terminals, and cables that run beside power cables",
    foretold=OF_A_LINE,
)
def interference(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage of all senders alike."""
    struck = _anywhere(evidence, sparse=True)
    if struck.bits > struck.against:
        yield _suspicion(evidence, struck, {})


@suspect(
    "emi-mains",
    Severity.ERROR,
    blame="line",
    text="Interference in step with the mains: {hits:,} hits, {alike:.0%} of them at one phase of {frequency:.2f} Hz",
    share=_SHARE,
    deciding_test="Look at A against B with an oscilloscope triggered by the mains",
    remedy="Look for thyristors, dimmers, welding or a soft starter on the same supply; separate the bus cable from "
    "power "
    "cables, earth the shield, use an isolated converter",
    foretold=_OF_INTERFERENCE,
)
def emi_mains(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage at one phase of the mains or of its half-waves."""
    struck = _anywhere(evidence, sparse=True)
    if struck.bits <= struck.against or not evidence.ledger.timed or evidence.verdict.wait_ns > _PHASE_NS:
        return
    times = _times_of_hits(evidence)
    if len(times) < _LEAST:
        return
    for mains, strays in _MAINS:
        for per_wave in (1, 2):
            found = _phases(times.tobytes(), per_wave * (mains - strays), per_wave * (mains + strays))
            if found.bits >= _SURE_BITS:
                numbers = {"frequency": found.frequency / per_wave, "alike": found.alike}
                more = struck._replace(bits=struck.bits + found.bits)
                yield _suspicion(evidence, more, numbers, period_s=round(1 / found.frequency, 6))


@lru_cache(maxsize=8)
def _phases(times: bytes, low: float, high: float) -> Phases:
    """Of the same times it is asked again when another cause is struck."""
    return phase_bits(np.frombuffer(times), low, high)


def _times_of_hits(evidence: Evidence) -> np.ndarray[Any, np.dtype[np.float64]]:
    """When damage struck, s, as far as its place is known; of a long capture where most of it is close together."""
    times: list[int] = []
    for unit in evidence.units:
        for reading in evidence.readings(unit):
            if reading.damage is AnswerDamage.BITS and reading.t_ns >= 0:
                times.append(reading.t_ns)
    most = CrowdedTimes()
    most.add(np.sort(np.concatenate((np.array(times, np.float64), evidence.ledger.stray_times.numbers))))
    return most.numbers / 1e9


@suspect(
    "emi-drive",
    Severity.ERROR,
    blame="line",
    text="The line is disturbed while {area} {address} of unit {unit} is {value}: {then:,} of {then_of:,} exchanges are "
    "hit then, {else_:,} of "
    "{else_of:,} otherwise",
    share=_SHARE,
    deciding_test="Compare the times of damaged frames with the changes of this value in the plant's log; switch "
    "nothing for the test without the operator",
    remedy="Route the bus cable away from the motor cable of this drive; earth that cable's shield at both ends, fit a "
    "filter "
    "or a ferrite at its output",
    foretold=_OF_INTERFERENCE,
)
def emi_drive(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage that goes with a value on the bus."""
    state = evidence.ledger.states.likeliest()
    if state is None or state.bits < _SURE_BITS:
        return
    by_time = max(state.bits, spells_of_hits(evidence)[0]) if _is_told(evidence) else state.bits
    struck = _anywhere(evidence, sparse=True, by_time=by_time)
    if struck.bits <= struck.against:
        return
    area = {1: "coil", 2: "discrete input", 3: "holding register", 4: "input register"}[state.function]
    numbers = {
        "area": area,
        "address": state.address,
        "unit": state.unit,
        "value": state.value,
        "then": state.hits,
        "then_of": state.trials,
        "else_": state.other_hits,
        "else_of": state.other_trials,
    }
    yield _suspicion(evidence, struck, numbers)


def _is_told(evidence: Evidence) -> bool:
    """Whether a value on the bus comes and goes about as often as the damage does, and tells each hit about as well as
    the times do: then they are its times."""
    state, (found, inside) = evidence.ledger.states.likeliest(), spells_of_hits(evidence)
    if state is None or state.bits < _SURE_BITS or state.contrast < _CONTRAST or not found:
        return False
    spells = int(np.count_nonzero(np.diff(inside.astype(np.int8), prepend=0) > 0))
    a_hit = found / int(evidence.ledger.grid.counts("damage").sum())
    told = state.bits / (state.hits + state.other_hits)
    return state.periods > 1 and _SWITCHES <= state.switches <= _SWITCHES * spells and told >= _AS_WELL * a_hit


@suspect(
    "hours",
    Severity.ERROR,
    blame="line",
    text="Interference at certain times: {inside:,} of {hits:,} hits fall into {spells:spell|spells}, {part:.0%} of the "
    "time",
    share=_SHARE,
    deciding_test="Ask what runs in the plant at these times, and record over a week",
    remedy="Find the machine that runs then (shift, pump, charger, lighting) and keep the bus cable away from its "
    "cables",
    foretold=_OF_INTERFERENCE,
)
def hours(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage in spells that nothing on the bus tells; that a line floats does not come and go."""
    grid = evidence.ledger.grid
    found, inside = spells_of_hits(evidence)
    if not found or grid.begin_ns is None or _is_told(evidence):
        return
    struck = _anywhere(evidence, sparse=True, by_time=found)
    if struck.bits <= struck.against:
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
        "since": grid.begin_ns + int(begins[0]) * grid.width_ns,
        "until": end_of_part(evidence, int(ends[-1])),
    }
    if len(begins) > 2:
        times["period_s"] = round(float(np.diff(begins).mean()) * grid.width_ns / 1e9, 1)
    yield _suspicion(evidence, struck, numbers, **times)
