"""Taps: a viewer fed by a hostile one, and a tap asked by hostile viewers, with whatever they send.

A viewer gives items that are in order and of the line, or one line of error, and takes nothing of a tap that did not
prove the token; a tap lets nobody in who did not, and goes on serving the others.
"""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from random import Random
from typing import Any, Final
from unittest import mock

from attack.inputs import spoilt
from attack.target import LINE, Outcome, conversation
from captures import Block
from captures.errors import CaptureError
from captures.live import tapstream
from captures.live.batching import event_record, position_record, tick_record
from captures.live.tapserver import TapServer
from captures.live.tapstream import VERSION, Proving, hear, new_nonce, send_line
from captures.live.tapviewer import TapViewer
from captures.live.wire import PortEvent, Tick, WireError, records_of

_TOKEN: Final = "0123456789abcdef"
_NONCE: Final = "00" * 16
_PATIENCE_S: Final = 20.0
_HELLO_S: Final = 0.5
_GREETING: Final = json.dumps({"rtuscope_tap": VERSION, "nonce": _NONCE}).encode() + b"\n"
_WORDS: Final = (
    b'"rtuscope_tap"',
    b'"nonce"',
    b'"proof"',
    b'"session"',
    b'"next"',
    b"null",
    b"-1",
    b"1e999",
    b"\n",
    b"{",
)


def attack(seed: int, count: int) -> Outcome:
    """So many inputs, half of them a tap's, half viewers'."""
    outcome, begun = Outcome("taps"), time.monotonic()
    taken = 0
    with mock.patch.object(tapstream, "HELLO_S", _HELLO_S):  # a line that does not end is waited for
        for number in range(count):
            chance = Random(f"{seed} taps {number}")
            try:
                taken += _viewed(chance) if number % 2 else _asked(chance)
            except Exception as error:
                again = f"benchmarks/attack taps --seed {seed}, input {number}"
                outcome.failures.append(f"{again}: {type(error).__name__}: {error}")
            outcome.tried += 1
    outcome.figures = f"seed {seed}, {taken:,} items taken or viewers let in, {time.monotonic() - begun:.0f} s"
    return outcome


def _stream(chance: Random) -> bytes:
    """What a tap sends behind its greeting, good or spoilt."""
    t_ns = 10**18
    records = [position_record(t_ns, {"next": 0, "heard": 0, "line": LINE.to_header()})]
    for chunk in conversation(chance, 8):
        t_ns += chance.choice((0, 1, 10**6))
        records += [record for record, _ in records_of(Block.from_chunks([type(chunk)(t_ns, chunk.data)]))]
        records += [tick_record(t_ns)] if chance.random() < 0.3 else []
        records += [event_record(t_ns, 0, chance.choice(("lost", "opened", "settled", "x")), "bus: \x1b[2J")]
    if chance.random() < 0.3:
        chance.shuffle(records)
    data = b"".join(records)
    return data if chance.random() < 0.3 else spoilt(chance, [data], _WORDS)


class _Pair:
    """A viewer whose connection is the other end of a pair of sockets: no port, no waiting for one."""

    def __init__(self, token: str | None) -> None:
        self.viewer: Any = TapViewer("tap://127.0.0.1:1", token=token)
        self.near, self.far = socket.socketpair()

    def greeted(self) -> Iterator[PortEvent | Block | Tick]:
        """What it takes: its own greeting and stream, once."""
        session, rest = self.viewer._greeted(self.near)
        self.viewer._session = session
        yield from self.viewer._streamed(self.near, rest)


def _viewed(chance: Random) -> int:
    token = chance.choice((None, _TOKEN))
    knows = chance.random() < 0.7
    pair = _Pair(token)
    answered: list[bool] = []

    def tap() -> None:
        with pair.far, suppress(OSError, WireError, KeyError, TypeError, ValueError):
            pair.far.settimeout(_PATIENCE_S)
            pair.far.sendall(_GREETING if chance.random() < 0.8 else spoilt(chance, [_GREETING], _WORDS))
            asked, _ = hear(pair.far)
            right = Proving(token if knows else "x" * 16, _NONCE, asked["nonce"]).proof("tap", "s")
            answer = json.dumps({"session": "s", "proof": right}).encode() + b"\n"
            spoil = chance.random() < 0.2
            answered.append(knows and not spoil)
            pair.far.sendall((spoilt(chance, [answer], _WORDS) if spoil else answer) + _stream(chance))

    thread = threading.Thread(target=tap, daemon=True)
    thread.start()
    items: list[Any] = []
    with pair.near, suppress(CaptureError, OSError, WireError, ValueError):
        items += pair.greeted()
    thread.join(_PATIENCE_S)
    assert not thread.is_alive(), "it waits for ever"
    assert not items or knows or token is None or answered == [], "taken of a tap that proved nothing"
    times = [int(t) for item in items if isinstance(item, Block) for t in item.t_ns]
    assert all(a <= b for a, b in pairwise(times)), "times go back"
    assert all("\n" not in item.text and len(item.text) <= 1100 for item in items if isinstance(item, PortEvent))
    return len(items)


def _asked(chance: Random) -> int:
    """A tap of its own for each, asked by some; of whom those who know the token are let in."""
    token = chance.choice((None, _TOKEN))
    server = TapServer("127.0.0.1", 0, tell=lambda _: None, token=token)
    try:
        for _ in range(3):
            with socket.create_connection(("127.0.0.1", server.port), _PATIENCE_S) as connection:
                _spoilt_viewer(connection, chance, token)
        with socket.create_connection(("127.0.0.1", server.port), _PATIENCE_S) as connection:
            greeting, _ = hear(connection)
            proving = Proving(token, greeting["nonce"], new_nonce())
            send_line(connection, {"nonce": proving.viewer_nonce, "proof": proving.proof("viewer", ""), "session": ""})
            answer, _ = hear(connection)
            assert proving.proved(answer.get("proof"), "tap", answer["session"]), "a good viewer is not let in"
    finally:
        server.close()
    return 1


def _spoilt_viewer(connection: socket.socket, chance: Random, token: str | None) -> None:
    """One that says what is nearly right: it must not be let in unless what it showed is the proof."""
    with suppress(OSError, WireError):
        greeting, _ = hear(connection)
        theirs = new_nonce()
        guess = chance.choice((Proving(None, greeting["nonce"], theirs), Proving(_TOKEN, theirs, greeting["nonce"])))
        words = {"nonce": theirs, "proof": guess.proof(chance.choice(("viewer", "tap")), "s"), "session": "", "next": 0}
        line = json.dumps(words).encode() + b"\n"
        connection.sendall(line if chance.random() < 0.3 else spoilt(chance, [line], _WORDS))
        connection.shutdown(socket.SHUT_WR)
        answer, _ = hear(connection)
        assert token is None or "session" not in answer, "let in without the token"
