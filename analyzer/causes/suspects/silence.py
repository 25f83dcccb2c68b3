"""Units that do not answer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from statistics import median
from typing import Any, Final

from ...tables.findings import Severity
from ...tables.transactions import ECHOED
from ..answeredas import answered_as
from ..bits import clustering_bits, mean_period_s, regularity_bits, surplus_bits
from ..costs import LostAnswers, cost, together
from ..evidence import Evidence
from ..exchanges import Ending
from ..flatmemory import Spell
from ..rawbytes import is_of_line
from ..registry import COMES_AND_GOES, Foretold, Suspicion, Symptom, suspect
from ..repeats import in_vain, only_repeats
from ..scans import is_looked_for, scanned
from ..signatures import AnswerDamage
from ..unitledger import UnitLedger
from .common import silent_suspicion
from .states import excused

EXCUSED: Final = "got an exception by which a gateway says that its target is silent"
SILENT: Final = "got no byte back"
_LEAST: Final = 5  # requests without an answer
_LEAST_OF_SEVERAL: Final = 3
_STRAY_BYTES: Final = 2
_STRAYS: Final = 0.05  # of requests, or as often as others are hit: bytes that may be noise, not answers
_BACKGROUND: Final = 0.02
_MANY_TRIES: Final = 4.5  # a poll
_SPELL: Final = 3  # requests in a row
_PAIR: Final = 2  # and of those, more than retries, where so long is between them:
_PAIR_TIMEOUTS: Final = 3
_TO_THE_END: Final = 8
_END_SHARE: Final = 0.1  # of the capture
_LONG_SPELL: Final = 12  # requests,
_VISITS_IN_VAIN: Final = 4  # or so many times that the master came back to it: what is lost once is not asked for anew
_VISITS_ONCE: Final = 3  # of a unit that answers before and behind
_ALL: Final = 0.5
_HALF: Final = 0.5
_SPEAKS_NOT: Final = (Symptom.SILENCE, Symptom.DAMAGE, Symptom.MARKS)  # nor is what seems to be its answer damaged
_HARDLY: Final = 0.25  # of what would be so by chance
_SCATTERED: Final = 0.03  # of what goes without an answer in a row or alone: alone beside restarts
_SURE_BITS: Final = 8.0


def _never(evidence: Evidence) -> list[UnitLedger]:
    """Units of which nothing was ever heard, those apart that somebody looked for once."""
    looked_for = scanned(evidence)
    found = [
        unit
        for unit in evidence.units
        if _surely_in_vain(evidence, unit) >= _LEAST_OF_SEVERAL
        and unit.unit not in looked_for
        and answered_as(evidence, unit.unit) is None
        and (not unit.answered + unit.loose or only_repeats(evidence, unit))
        and _answering(evidence, unit) <= max(_STRAYS, evidence.elsewhere(unit)) * unit.asked
    ]
    return found if len(found) > 1 else [unit for unit in found if _surely_in_vain(evidence, unit) >= _LEAST]


def _surely_in_vain(evidence: Evidence, unit: UnitLedger) -> int:
    """Requests to a unit that stayed without an answer for sure."""
    silent = evidence.silent(unit)
    is_open = evidence.is_open(Symptom.SILENCE, unit.unit)
    return in_vain(evidence, unit)[0] if is_open and silent >= unit.count(Ending.SILENT) else silent


def _cost(evidence: Evidence, unit: UnitLedger) -> LostAnswers:
    """The same, and the time that the master waited."""
    silent, whole = in_vain(evidence, unit)[0], cost(evidence, unit, Ending.SILENT)
    if not unit.answered:
        return LostAnswers(max(silent, whole.answers), whole.ms)
    waited = unit.echo_delays.total + unit.pauses.total
    if not waited or evidence.verdict.wait_ns * unit.answered > waited:
        return LostAnswers(silent)
    return LostAnswers(silent, round((whole.ms or 0.0) + waited / 1e6, 3))


def _answering(evidence: Evidence, unit: UnitLedger) -> float:
    """About how many damaged answers of a unit may be its: not those of a byte or two, nor the master's next request, nor
    what begins as the frames of another."""
    every = evidence.garbage(unit)
    readings = [each for each in every if each.damage is not AnswerDamage.NONE]
    own = [each for each in readings if each.damage is not AnswerDamage.CROSSED and each.length > _STRAY_BYTES]
    own = [each for each in own if evidence.begun_by(each) is None]
    if unit.count(Ending.GARBAGE) <= _HALF * unit.asked:  # by other settings it would answer so each time
        own = [each for each in own if not is_of_line(each.heard)]
    return unit.count(Ending.GARBAGE) * (len(own) / len(every) if every else 1)


def _died(evidence: Evidence, unit: UnitLedger) -> int | None:
    """Since when a unit that did answer has been silent to the end."""
    spells = evidence.silences(unit)
    spell = spells.lasting
    if spell is None or not unit.answered or not evidence.silent(unit) or only_repeats(evidence, unit):
        return None
    before = max((each.count for each in spells.all if each is not spell), default=0)
    span = evidence.ledger.grid.width_ns * 256 if not evidence.ledger.timed else evidence.ledger.span_ns
    since = spell.begin if spell.after is None else spell.after  # its silence begins behind its last answer
    lasted = (evidence.ledger.end - since if evidence.ledger.timed else spell.end - spell.begin) / max(span, 1)
    long = lasted >= _END_SHARE or spell.count >= _LONG_SPELL or spell.visits >= _VISITS_IN_VAIN
    return spell.begin if long and spell.count >= max(_TO_THE_END, 3 * before) else None


def _tries(evidence: Evidence, unit: UnitLedger) -> float:
    """Requests a poll; one of a list that holds nothing else, which comes again and again by itself."""
    return unit.asked / max(unit.asked - unit.repeats, 1) if len(evidence.polls) > 1 else 1.0


def silence_bits(silent: int, asked: int) -> float:
    """How much likelier so much silence is as a fault than as what is lost on any line."""
    return surplus_bits(silent, asked, _BACKGROUND)


@suspect(
    "dead-unit",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} {answers}: {silent:,} of {asked:,} requests to it {how}[, while {others_answered:,} of "
    "{others_asked:,} to other units were answered]",
    share="{silent:,} of {asked:,} requests to unit {unit}[, {others_silent:,} of {others_asked:,} to others]",
    deciding_test="Look at the unit's power lamp, its address and its settings first; then connect a client straight "
    "to unit {unit}, without the bus, and read from it: if it stays silent, it is the unit; if it answers, its drop "
    "or the wiring there",
    remedy="Check the unit's power, its address, and whether A and B are swapped at it; remove it from the poll list "
    "if it does not exist",
    foretold=Foretold(hangs_on={Symptom.SILENCE: COMES_AND_GOES}),
)
def dead_unit(evidence: Evidence) -> Iterator[Suspicion]:
    """One unit of several."""
    never = _never(evidence)
    if len(never) == 1 and _tries(evidence, never[0]) < _MANY_TRIES:
        yield _silence(evidence, never[0], None)
    for unit in evidence.units:
        since = _died(evidence, unit)
        if since is not None:
            yield _silence(evidence, unit, since)
    yield from _excused(evidence)


def _excused(evidence: Evidence) -> Iterator[Suspicion]:
    """A unit of which a gateway says that it does not answer, and nothing else from some moment on."""
    found = excused(evidence)
    if len(found) != 1:
        return  # of several it is what they share
    ((number, state),) = found.items()
    unit = evidence.ledger.units[number]
    if any(other.answered for other in evidence.others(unit)):
        bits, kinds = silence_bits(state.refused, state.asked), (Symptom.REFUSAL, Symptom.SILENCE)
        numbers = {"silent": state.refused, "asked": state.asked, "how": EXCUSED, **_answers(state.begin)}
        lost = LostAnswers(state.refused)
        cause = silent_suspicion(evidence, [unit], bits, kinds, numbers, lost, Ending.EXCEPTION)
        yield replace(cause, since=state.since(unit))


def _answers(since: int | None) -> dict[str, str]:
    return {"answers": "never answers" if since is None else "answers no more"}


def _silence(evidence: Evidence, unit: UnitLedger, since: int | None) -> Suspicion:
    silent, asked = in_vain(evidence, unit)
    lasting = evidence.silences(unit).lasting
    bits = silence_bits(silent, asked)
    if since is not None and lasting is not None:
        silent, bits = lasting.count, silence_bits(lasting.count, lasting.count)
    numbers = {"silent": silent, "asked": asked if since is None else silent, "how": SILENT, **_answers(since)}
    if since is not None:
        lost = cost(evidence, unit, Ending.SILENT)
        return replace(silent_suspicion(evidence, [unit], bits, (Symptom.SILENCE,), numbers, lost), since=since)
    severity = Severity.NOTE if is_looked_for(evidence, unit) else None
    return replace(
        silent_suspicion(evidence, [unit], bits, _SPEAKS_NOT, numbers, _cost(evidence, unit)), severity=severity
    )


@suspect(
    "absent-units",
    Severity.ERROR,
    blame="master",
    text="{count:,} of {polled:,} polled units never answer ({list}): {silent:,} requests to them got no byte back",
    share="{silent:,} of {asked:,} requests to units {list}[, {others_silent:,} of {others_asked:,} to others]",
    deciding_test="Check that these units exist and have power; then read from each of them alone: if one answers "
    "then, the bus or its drop is at fault, not the list",
    remedy="Remove units that do not exist from the poll list; check power, address and wiring of those that do",
)
def absent_units(evidence: Evidence) -> Iterator[Suspicion]:
    """Several units, and some that do answer."""
    never = sorted(_never(evidence), key=lambda unit: -in_vain(evidence, unit)[0])
    if len(never) < 2:
        return
    weight = 1.0 if evidence.others(*never) else _ALL  # where nobody answers at all, the fault is hardly theirs
    counts = [in_vain(evidence, unit) for unit in never]
    lost = together(_cost(evidence, unit) for unit in never)
    bits, (silent, asked) = weight * sum(silence_bits(*each) for each in counts), map(sum, zip(*counts, strict=True))
    numbers: dict[str, Any] = {"count": len(never), "polled": len(evidence.units), "silent": silent, "asked": asked}
    numbers["list"] = tuple(unit.unit for unit in never)
    severity = Severity.NOTE if all(is_looked_for(evidence, unit) for unit in never) else None
    yield replace(silent_suspicion(evidence, never, bits, _SPEAKS_NOT, numbers, lost), severity=severity)


@suspect(
    "retry-policy",
    Severity.WARNING,
    blame="master",
    text="The client asks unit {unit}, which never answers, {tries:.0f} times a poll before it goes on: {silent:,} "
    "requests without result",
    share="{silent:,} of {asked:,} requests to unit {unit}, {tries:.1f} a poll",
    deciding_test="Look at the client's retries and timeout: their product is what each poll of a silent unit costs",
    remedy="Let the client give up after one or two retries and ask a silent unit again only now and then; find out "
    "why "
    "unit {unit} is silent",
)
def retry_policy(evidence: Evidence) -> Iterator[Suspicion]:
    """A silent unit that is asked again and again."""
    never = _never(evidence)
    for unit in never if len(never) == 1 else ():
        tries = _tries(evidence, unit)
        if tries >= _MANY_TRIES:
            found = _silence(evidence, unit, None)
            yield replace(found, bits=found.bits + tries, numbers={**found.numbers, "tries": tries}, severity=None)


@suspect(
    "unit-restarts",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} goes silent[ for about {length:sec}][, {row:request|requests} in a row], {often}: {silent:,} "
    "requests got no byte back",
    share="{silent:,} of {asked:,} requests to unit {unit}; spells of silence: {spells}",
    deciding_test="Watch the unit's power and its running light, or its uptime register, when it goes silent next",
    remedy="Check the unit's supply and its connector; a watchdog that resets it points to its firmware or to "
    "interference",
    foretold=Foretold(hangs_on={Symptom.SILENCE: COMES_AND_GOES - {"unit-before"}}),
)
def unit_restarts(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence in spells, or in one long one, good answers before and behind."""
    for unit in evidence.units:
        silent, spells = evidence.silent(unit), _spells(evidence, unit)
        inside = sum(each.count for each in spells)
        if _are_second_answers(evidence, unit) or only_repeats(evidence, unit):
            continue
        once = len(spells) == 1 and spells[0].before is not None
        once = once and (spells[0].count >= _TO_THE_END or spells[0].visits >= _VISITS_ONCE)
        if (len(spells) < 2 and not once) or not unit.answered or inside < 0.6 * silent or inside < 2 * _SPELL:
            continue
        silences = evidence.silences(unit)
        begins = [each.begin for each in spells]
        in_spells = clustering_bits(silent, unit.asked, len(silences.all) + silences.single + silences.more)
        in_spells += regularity_bits(begins)
        if in_spells < _SURE_BITS or _scattered_bits(evidence, unit) >= _SURE_BITS:
            continue  # by chance as well, or it answers some meanwhile
        lost, timed = cost(evidence, unit, Ending.SILENT), evidence.ledger.timed
        numbers = {
            "spells": len(spells) + silences.more,
            "silent": silent,
            "asked": unit.asked,
            "length": median(each.end - each.begin for each in spells) / 1e9 if timed else 0.0,
            "row": 0 if timed else round(median(each.count for each in spells)),
            "often": "once" if once else "again and again",
        }
        bits, period_s = silence_bits(silent, unit.asked) + in_spells, None if once else mean_period_s(begins)
        cause = silent_suspicion(evidence, [unit], bits, (Symptom.SILENCE,), numbers, lost)
        severity = Severity.NOTE if once else None
        yield replace(cause, since=begins[0], until=spells[-1].end, period_s=period_s, severity=severity)


def _scattered_bits(evidence: Evidence, unit: UnitLedger) -> float:
    """How much likelier so many single requests without an answer are, beside spells, than where only what others suffer
    as well leaves any."""
    silences = evidence.silences(unit)
    runs = len(silences.all) + silences.more + silences.single
    others = [other for other in evidence.others(unit) if other.answered]
    elsewhere = sum(evidence.silences(other).single for other in others) / max(sum(each.asked for each in others), 1)
    due = min(elsewhere * unit.asked / max(runs, 1), _HALF)
    return surplus_bits(silences.single, runs, max(due, _SCATTERED))


def _are_second_answers(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether next to no request is silent but such whose answer reads like it, though others are asked: of two answers
    to one the second reads like a request that stayed without."""
    polls = [poll for poll in evidence.polls_of(unit.unit) if not ECHOED[poll.function]]
    asked, silent = sum(poll.asked for poll in polls), unit.count(Ending.SILENT)
    if evidence.echoed_again(unit) > (1 - _HARDLY) * silent:
        return True
    return bool(asked) and evidence.unanswered(unit) < _HARDLY * silent * asked / unit.asked


def is_spell(evidence: Evidence, spell: Spell) -> bool:
    """Whether a unit was silent for a while: to several requests, or to two that are no retry of one poll."""
    if spell.count >= _SPELL:
        return True
    timeout = evidence.timeout_ns  # None without times
    return spell.count == _PAIR and timeout is not None and spell.end - spell.begin >= _PAIR_TIMEOUTS * timeout


def _spells(evidence: Evidence, unit: UnitLedger) -> list[Spell]:
    """When a unit was silent for a while; of two requests where nothing is ever asked again at once."""
    return [
        each
        for each in evidence.silences(unit).all
        if is_spell(evidence, each) or (each.count == _PAIR and not unit.repeats)
    ]
