"""What is wrong with the wires: reflections, no bias, one bad drop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import log2
from typing import Final

from ...tables.findings import Severity
from ..bits import likelihood_bits, surplus_bits
from ..costs import kind_bits, kind_of, share_of
from ..evidence import HEALTHY, Evidence, usual_rate
from ..hits import (
    ALIKE,
    WELL,
    Hits,
    apart_bits,
    span_of_hits,
    spared_bits,
    spares_units,
    unlike_idle_bits,
)
from ..ledger import STRAY
from ..registry import OF_A_LINE, Explained, Suspicion, Symptom, suspect
from ..signatures import Signature
from ..unitledger import UnitLedger
from .common import damage_suspicion

_LEAST: Final = 5
_SOONEST: Final = 0.05  # of answers
_HALF_CHAR: Final = 0.5
_LOST: Final = 2  # bytes
_MOST: Final = 0.6
_FEW: Final = 0.15  # frames hit for a stretch on the idle line,
_LESS: Final = 0.5  # or so many of those that would be if it were all the same whether somebody sends
_FULL: Final = 0.95
_EARLY: Final = (0.3, 0.22, 0.16, 0.12, 0.08, 0.05, 0.04, 0.03)  # bits of a byte that ringing behind its start reaches
# AnswerDamage by reflections, one bit a frame, or several.
_BENT: Final = {"bits": 0.52, "head": 0.17, "bits-tail": 0.04, "middle": 0.1, "whole": 0.12, "tail": 0.02}
_MUCH_BENT: Final = {"bits": 0.2, "head": 0.1, "bits-tail": 0.03, "middle": 0.35, "whole": 0.3, "tail": 0.01}
_SINGLE: Final = 0.3
_SOME_SINGLE: Final = 0.1
_MOST_BENT: Final = 0.45
_SURELY_EARLY: Final = 8.0  # bits
_UNIT_BITS: Final = 6.0  # each unit more that is said to be far


@suspect(
    "bias",
    Severity.WARNING,
    blame="line",
    text="The idle line is not biased: {idle} stretches of stray bytes on the idle line, while "
    "{well:,} of {exchanges:exchange|exchanges} {well:|shows|show} no damage",
    share="{idle} stretches in {exchanges:,} exchanges[, {damaged:damaged answer|damaged answers}]",
    deciding_test="Measure A against B on the idle line: under 200 mV it floats",
    remedy="Fit bias resistors (pull-up on B, pull-down on A as the Modbus specification names them, 450 to 650 ohm) "
    "at one "
    "place of the bus, or switch the client's on; many makers print A and B the other way round",
)
def bias(evidence: Evidence) -> Iterator[Suspicion]:
    """Noise between frames, and frames that are well."""
    hits = Hits(evidence)
    if hits.idle < _LEAST or spares_units(evidence):
        return
    touched = sum(_run_into(evidence, unit) for unit in evidence.units)
    touched = min(touched, hits.idle)  # the moments before an answer are less than all the idle time
    idle, frames = hits.idle + touched, hits.frames - touched
    hit = idle + frames if hits.damaged < _FEW * idle else idle
    bits = surplus_bits(hit, max(hits.exchanges, hit), HEALTHY)
    bits += likelihood_bits(frames, idle + frames, WELL) - likelihood_bits(frames, idle + frames, 0.5)
    inside = sum(evidence.damaged_so(unit, _is_inside) for unit in evidence.units)
    against = surplus_bits(inside, hits.exchanges, HEALTHY)  # a driven line does not float
    against += unlike_idle_bits(evidence)
    against += apart_bits(evidence)  # a line that floats does so behind everybody
    explains: Explained = frozenset((Symptom.BEHIND, u.unit) for u in evidence.units if not evidence.tails(u))
    explains |= {(Symptom.FRAMING, None)}
    load = min(evidence.load or 0.0, _FULL)
    if touched > _MOST * hits.damaged or hits.damaged < max(_FEW, _LESS * load / (1 - load)) * idle:
        explains |= frozenset((Symptom.DAMAGE, unit.unit) for unit in evidence.units)
    yield Suspicion((), bits, explains, hits.numbers, against=against, **span_of_hits(evidence))


def _is_inside(reading: Signature) -> bool:
    """Whether an answer is damaged where only what meets a driven line can have struck."""
    return kind_of(reading) in ("bits", "bits-tail", "middle")


def _run_into(evidence: Evidence, unit: UnitLedger) -> float:
    """About how many damaged answers of a unit noise runs into the beginning of: bytes come before it ever answers."""
    soonest = unit.delays.quantile(_SOONEST) or 0.0
    before = soonest - evidence.verdict.wait_ns - _HALF_CHAR * evidence.ledger.char_ns
    return evidence.damaged_so(
        unit,
        lambda each: (
            kind_of(each) in ("head", "ahead")
            or (0 <= each.delay < before and each.length >= each.due - _LOST)  # its answer came, too
            or (kind_of(each) == "whole" and each.length <= STRAY)  # no answer did: it ran into the request
        ),
    )


@suspect(
    "termination",
    Severity.ERROR,
    blame="line",
    text="Answers of {units:unit|units} come with flipped bits ({damaged:,} of {answers:,}), requests and what others send "
    "hardly do: reflections on the way from there{early}",
    share="{damaged:,} of {answers:,} answers of {units:unit|units}[, {others_damaged:,} of {others_answers:,} of others]",
    deciding_test="Measure the resistance between A and B with the supply off: about 60 ohm with both ends "
    "terminated; then put 120 ohm across A and B at the far end: the errors must go",
    remedy="Terminate both ends of the cable with 120 ohm, and nowhere else; shorten stubs; avoid stars",
    foretold=OF_A_LINE,
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
        rest = evidence.others(*far)
        hits, trials = sum(map(evidence.damaged, rest)), sum(unit.asked for unit in rest)
        background = usual_rate(hits, trials)
        readings = [reading for unit in far for reading in evidence.readings(unit)]
        flips = [bit for reading in readings for bit in reading.flips]
        early = sum(log2(8 * _EARLY[bit]) for bit in flips)
        bits = sum(surplus_bits(evidence.damaged(unit), unit.asked, background) for unit in far)
        bits += max(kind_bits(readings, _BENT), kind_bits(readings, _MUCH_BENT)) + early - _UNIT_BITS * (count - 1)
        bits += sum(spared_bits(evidence, unit) for unit in far)
        single, several = share_of(readings, "bits", "bits-tail"), share_of(readings, "middle")
        bent = single >= _SINGLE or (count > 1 and single >= _SOME_SINGLE and single + several >= _MOST_BENT)
        if bent and len(readings) >= _LEAST and (best is None or bits > best.bits):
            early_words = {"early": ", in the first bits behind an edge" if early > _SURELY_EARLY else ""}
            best = damage_suspicion(evidence, far, bits, early_words, (Symptom.DAMAGE,))
    if best is not None:
        yield best


@suspect(
    "bad-drop",
    Severity.ERROR,
    blame="line",
    text="Answers of unit {unit} are damaged in no particular way: {damaged:,} of {answers:,}[, those of others "
    "{others_damaged:,} of {others_answers:,}]",
    share="{damaged:,} of {answers:,} answers of unit {unit}[, {others_damaged:,} of {others_answers:,} of others]",
    deciding_test="Look at the terminals, the shield and the stub of this drop first; then swap the drops of unit "
    "{unit} and a good one: see if the damage stays with the unit or the drop",
    remedy="Check the terminals, the stub and the shield of this drop, then the unit's line driver",
    foretold=OF_A_LINE,
)
def bad_drop(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage of any kind, of one unit alone."""
    for unit in evidence.units if len(evidence.units) > 1 else ():
        bits = evidence.surplus(unit) - _UNIT_BITS
        against = max(-kind_bits(evidence.readings(unit), ALIKE), 0.0) - spared_bits(evidence, unit)
        against += surplus_bits(
            evidence.requests_behind(unit), max(unit.answered, 1), HEALTHY
        )  # no drop harms requests
        others = evidence.others(unit)
        loses = 0 < evidence.silent(unit) <= evidence.damaged(unit)  # the requests that it spoils on their way in
        if loses:
            elsewhere = (sum(map(evidence.silent, others)) + 0.5) / (sum(other.asked for other in others) + 1)
            bits += surplus_bits(evidence.silent(unit), unit.asked, max(elsewhere, HEALTHY))
        if bits > against and evidence.damaged(unit) >= _LEAST:
            kinds = (Symptom.DAMAGE, Symptom.SILENCE) if loses else (Symptom.DAMAGE,)
            yield replace(damage_suspicion(evidence, [unit], bits, symptoms=kinds), against=against)
