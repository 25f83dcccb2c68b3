"""What is said of requests by what became of them: the rules' words, and the columns that each speaks of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...languages import phrase
from ...tables.findings import About, Findings, Rule, Severity
from ...tables.schema import Protocol
from ...tables.transactions import NEVER, Status, TransactionRows
from .strangers import DUPLICATE

_ANSWERED, _UNANSWERED, _DAMAGED = int(Status.ANSWERED), int(Status.UNANSWERED), int(Status.DAMAGED)


def _silent(numbers: Mapping[str, float]) -> str:
    if "waited_ms" in numbers:
        return phrase("unit {unit:.0f} did not answer in {waited_ms:ms}, until the next request", numbers)
    return phrase("unit {unit:.0f} did not answer", numbers)


NO_RESPONSE: Final = Rule(
    "no-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="nobody answers a request",
    clause="[2] 2.4.1",
    numbers=("unit", "waited_ms", "function", "answered_before", "over_tcp"),
    varies="answered_before",
    loses=True,
    wastes="waited_ms",
    text=_silent,
    cause=lambda numbers: phrase(
        "a request that reached it damaged, a unit that restarts or is busy, or a loose contact: it answers otherwise"
        if numbers["answered_before"]
        else "no such unit behind this server, or one that its serial line does not reach"
        if "over_tcp" in numbers
        else "it has not answered so far: no such unit, or one without power; else a wrong baud rate or parity, "
        "swapped A and B, or a request that reached it damaged"
    ),
    remedy=lambda numbers: phrase(
        "look when it falls silent: its power, its connector, what the client asks of it just then"
        if numbers["answered_before"]
        else "check the unit's number, and the line behind the gateway if it is one; take it off the poll list if it "
        "is not there"
        if "over_tcp" in numbers
        else "check the unit's power, address, line settings and wiring; take it off the poll list if it is not there"
    ),
)
RETRY: Final = Rule(
    "retry",
    Severity.NOTE,
    About.TRANSACTION,
    when="the same request comes again after no answer or a damaged one",
    clause="[2] 2.4.1",
    numbers=("unit", "after_ms"),
    text=lambda numbers: (
        phrase("the client repeats its request")
        + (phrase(", {after_ms:ms} after the first try", numbers) if "after_ms" in numbers else "")
    ),
    cause="it got no answer, a damaged one or one too late",
    remedy="look at what became of the request before",
)


def _came_late(numbers: Mapping[str, float]) -> str:
    words = phrase("unit {unit:.0f} answers frame {request:.0f}", numbers)
    words += phrase(", {late_ms:ms} after it", numbers) if "late_ms" in numbers else ""
    words += phrase(", when the client has gone on; ")
    return words + phrase(
        "it fits the client's newest request as well, which takes these values one poll too late"
        if numbers["mistaken"]
        else "it does not fit the client's newest request, which can reject it"
    )


LATE: Final = Rule(
    "late-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="an answer comes after the client has gone on to its next request",
    clause="[2] 2.4.1",
    numbers=("unit", "late_ms", "request", "mistaken", "waited_ms"),
    varies="mistaken",
    loses=True,
    wastes="waited_ms",
    text=_came_late,
    cause=lambda numbers: (
        phrase("the unit answers later than the client waits")
        + (
            phrase("; answers carry no register address, so nobody notices the wrong values")
            if numbers["mistaken"]
            else ""
        )
    ),
    remedy=lambda numbers: (
        phrase("make the client's response timeout longer than the unit's longest response time")
        + (phrase("; do not trust the values of this unit until then") if numbers["mistaken"] else "")
    ),
)
ECHO: Final = Rule(
    "echo",
    Severity.NOTE,
    About.TRANSACTION,
    when="the tap shows each sent frame twice",
    numbers=("after_ms",),
    text=lambda numbers: (
        phrase("the same frame once more")
        + (phrase(", {after_ms:ms} after itself", numbers) if "after_ms" in numbers else "")
    ),
    cause="the tap or a converter with local echo shows each sent frame twice",
    remedy="switch the converter's local echo off, or tap the line behind it",
)


def said(rule: Rule, transactions: TransactionRows, which: NDArray[np.intp], timed: NDArray[np.bool_]) -> Findings:
    """What a rule says of some transactions; `timed`: whether their times mean anything."""
    these, before = transactions[which], transactions[np.maximum(which - 1, 0)]
    columns = these.request, these.start, these.length, these.port, these.t_start_ns
    answers = (
        these.response, these.response_start, these.response_length, these.response_port, these.t_response_ns,
    )  # fmt: skip
    if rule is LATE:
        behind = np.where(timed, (these.t_response_ns - these.t_request_ns) / 1e6, np.nan)
        waited = np.where(timed & (these.t_next_ns != NEVER), (these.t_next_ns - these.t_request_ns) / 1e6, np.nan)
        return rule.at(*answers, these.unit, behind, these.request, these.mistaken, waited)
    if rule is DUPLICATE:
        own = these.status == _ANSWERED  # else what reads like a request is the second answer
        index = np.where(own, these.response, these.request)
        start, length = (
            np.where(own, answer, request)
            for answer, request in ((these.response_start, these.start), (these.response_length, these.length))
        )
        port, t_ns = (
            np.where(own, these.response_port, these.port),
            np.where(own, these.t_response_ns, these.t_start_ns),
        )
        first = np.where(own, these.t_start_ns, before.t_response_ns)
        later = np.where(timed, (t_ns - first) / 1e6, np.nan)
        return rule.at(index, start, length, port, t_ns, these.unit, later)
    if rule is NO_RESPONSE:
        waited = np.where(timed, (these.t_next_ns - these.t_request_ns) / 1e6, np.nan)
        over_tcp = np.where(these.protocol == Protocol.TCP, 1.0, np.nan)
        return rule.at(*columns, these.unit, waited, these.function, 0, over_tcp)
    if rule is RETRY:
        failed = (which > 0) & np.isin(before.status, (_UNANSWERED, _DAMAGED)) & timed
        return rule.at(*columns, these.unit, np.where(failed, (these.t_start_ns - before.t_start_ns) / 1e6, np.nan))
    if rule is ECHO:
        later = np.maximum(these.t_start_ns - before.t_request_ns, 0) / 1e6
        return rule.at(*columns, np.where(timed, later, np.nan))
    return rule.at(*columns, these.unit, these.function)
