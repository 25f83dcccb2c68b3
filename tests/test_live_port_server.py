"""A port server (RFC 2217) is listened to as it is: nothing is set there unasked, and nothing is purged."""

import argparse
import socket
import threading
import time
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from serial import rfc2217

from analyzer.cli.commands import UsageError
from analyzer.live.tapsource import TapSource
from captures.chunks import Block
from captures.live.gateway import PortServerTap, TelnetReceiver
from captures.live.settings import PortSettings
from captures.live.tap import PortError, PortGoneError
from captures.live.wire import PortEvent

IAC, DONT, DO, WONT, WILL, SB, SE = 255, 254, 253, 252, 251, 250, 240
COM_PORT, BAUD, CONTROL, PURGE = 44, 1, 5, 12
SENT = bytes.fromhex("1103006b00037687") + b"\xff\x00\xff\xff\r\n" + bytes(range(256))


class Line:
    """The serial port behind the server: everything that is done to it is in `changes`."""

    def __init__(self, **settings):
        values = {"baudrate": 19200, "bytesize": 8, "parity": "E", "stopbits": 1, "rts": True, "dtr": False}
        object.__setattr__(self, "changes", [])
        object.__setattr__(self, "values", {**values, **settings})

    cts = dsr = ri = cd = False
    xonxoff = rtscts = break_condition = False

    def __getattr__(self, name):
        if name in self.values:
            return self.values[name]
        return lambda *_: self.changes.append(name)

    def __setattr__(self, name, value):
        self.changes.append((name, value))
        self.values[name] = value


class Server:
    """pyserial's own port manager on a socket. `received` is all that clients sent; `say` is heard on the line."""

    def __init__(self, line, *, speaks=True):
        self.line, self._speaks = line, speaks
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self.received = b""
        self.manager: rfc2217.PortManager | None = None
        self.connection: socket.socket | None = None
        self.connected = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._listener.close()
        if self.connection is not None:
            self.connection.close()

    def write(self, data):
        assert self.connection is not None
        self.connection.sendall(data)

    def say(self, data):
        self.write(data if self.manager is None else b"".join(self.manager.escape(data)))

    def _serve(self):
        while True:
            try:
                self.connection, _ = self._listener.accept()
                self.manager = rfc2217.PortManager(self.line, self) if self._speaks else None
                self.connected.set()
                while data := self.connection.recv(1024):
                    self.received += data
                    if self.manager is not None:
                        assert b"".join(self.manager.filter(data)) == b"", "bytes for the line"
            except OSError:
                if self._listener.fileno() < 0:
                    return


def asked(stream):
    """The commands of RFC 2217 in what a client sent: (command, value)."""
    parts = stream.split(bytes([IAC, SB, COM_PORT]))[1:]
    return [(part[0], part[1 : part.index(bytes([IAC, SE]))]) for part in parts]


@pytest.fixture
def server():
    with Server(Line()) as serving:
        yield serving


def read_until(tap, count):
    data = b""
    while len(data) < count:
        data += tap.read()[0]
    return data


def test_it_is_listened_to_at_its_own_settings_and_nothing_is_changed_there(server):
    tap = PortServerTap(PortSettings(server.url), blocking=True)
    assert (tap.settings.baud, tap.settings.parity, tap.settings.stop_bits, tap.settings.data_bits) == (
        19200, "E", 1, 8,
    )  # fmt: skip
    server.say(SENT)
    assert read_until(tap, len(SENT)) == SENT
    tap.close()
    assert server.line.changes == []
    commands = asked(server.received)
    assert {command for command, _ in commands} <= {1, 2, 3, 4, CONTROL}
    assert all(value in ((7,), (10,)) if c == CONTROL else not any(value) for c, value in map(_pair, commands))


def _pair(command):
    return command[0], tuple(command[1])


def test_what_its_user_gave_is_set_and_nothing_else(server):
    given_settings = PortSettings(server.url, 9600, "N", remote_changes=("baud",))
    tap = PortServerTap(given_settings, blocking=True)
    assert server.line.changes == [("baudrate", 9600)]
    assert str(tap.settings) == "9600 8E1"
    tap.close()


def test_a_setting_that_the_server_refuses_is_told():
    class Stubborn(Line):
        def __setattr__(self, name, value):
            self.changes.append((name, value))

    with Server(Stubborn()) as server:
        tap = PortServerTap(PortSettings(server.url, 9600, remote_changes=("baud",)), blocking=True)
        assert tap.settings.baud == 19200
        assert [notice.partition(": ")[2] for notice in tap.notices] == ["baud 9600 is not set there: it is 19200"]
        tap.close()


def test_a_server_that_speaks_no_rfc_2217_is_heard_all_the_same(monkeypatch):
    monkeypatch.setattr("captures.live.gateway._NEGOTIATION_S", 0.2)
    with Server(Line(), speaks=False) as server:
        tap = PortServerTap(PortSettings(server.url), blocking=True)
        assert tap.settings.baud is None
        assert "its settings are not known" in tap.notices[0]
        server.say(b"\x01\x03\x02")
        assert read_until(tap, 3) == b"\x01\x03\x02"
        tap.close()


def test_lines_that_are_high_there_are_told():
    receiver = TelnetReceiver()
    receiver.feed(bytes([IAC, SB, COM_PORT, 100 + CONTROL, 11, IAC, SE, IAC, SB, COM_PORT, 100 + CONTROL, 9, IAC, SE]))
    assert receiver.lines == {"RTS": True, "DTR": False}


def test_a_changed_setting_counts_from_the_servers_answer_on(server):
    tap = PortServerTap(PortSettings(server.url), blocking=True)
    tap.change(PortSettings(server.url, 38400, "O"))
    while tap._unconfirmed:
        tap.read()
    assert (server.line.baudrate, server.line.parity) == (38400, "O")
    assert {name for name, _ in server.line.changes} == {"baudrate", "parity", "bytesize", "stopbits"}
    server.say(b"after")
    assert read_until(tap, 5) == b"after"
    tap.close()


def test_a_server_that_goes_away_is_a_port_that_is_gone(server):
    tap = PortServerTap(PortSettings(server.url), blocking=True)
    server.connection.shutdown(socket.SHUT_RDWR)
    with pytest.raises(PortGoneError):
        for _ in range(20):
            tap.read()
    tap.close()


def test_a_server_that_hangs_up_while_it_is_asked_is_told_in_one_line():
    listener = socket.create_server(("127.0.0.1", 0))
    threading.Thread(target=lambda: listener.accept()[0].close(), daemon=True).start()
    with pytest.raises(PortError, match="disconnected"):
        PortServerTap(PortSettings(f"rfc2217://127.0.0.1:{listener.getsockname()[1]}"))
    listener.close()


def events(source, until):
    """Events of a source, up to the first of this kind."""
    seen = []
    for item in source.items():
        if isinstance(item, PortEvent):
            seen.append(item)
            if item.kind == until:
                source.close()
    return seen


def test_a_source_takes_the_servers_settings_for_the_lines(server):
    source = TapSource([PortSettings(server.url)])
    kinds = [event.kind for event in events(source, "settled")]
    assert "seeking" not in kinds
    assert (source.line.baud, source.line.char_bits, source.line.parity) == (19200, 11, "E")
    assert server.line.changes == []


def test_settings_are_sought_there_only_where_that_is_allowed(server):
    source = TapSource([PortSettings(server.url)], seek_remote=True)
    kinds = [event.kind for event in events(source, "settings")]
    assert "seeking" in kinds
    until = time.monotonic() + 20
    while ("baudrate", 9600) not in server.line.changes:  # the server's own thread takes it off the wire
        assert time.monotonic() < until
        time.sleep(0.01)
    assert not [change for change in server.line.changes if isinstance(change, str)]  # no buffer was reset


def test_seeking_there_is_for_port_servers():
    from analyzer.cli.taps import tap_of

    arguments = argparse.Namespace(
        port="/dev/ttyX", port2=None, baud="auto", parity="auto", stop=None, bits=None, seek_remote=True
    )
    with pytest.raises(UsageError, match="rfc2217"):
        tap_of(arguments)


def test_only_what_was_typed_is_set_there(monkeypatch):
    from analyzer.cli import taps
    from analyzer.cli.app import Parser
    from analyzer.cli.commands import add_arguments

    parser = Parser()
    add_arguments(parser, "sniff")
    monkeypatch.setattr("analyzer.live.tapsource.TapSource", lambda ports, **_: ports)
    for words, changes in (
        ([], ()),
        (["--baud", "9600"], ("baud",)),
        (["--baud", "9600", "--parity", "E", "--stop-bits", "2"], ("baud", "parity", "stop_bits")),
    ):
        given: Any = taps.tap_of(parser.parse_args(["rfc2217://host:4000", *words]))
        (port,) = given  # what a tap would have been made of
        assert port.remote_changes == changes
        assert port.data_bits == 8


options = st.sampled_from([0, 1, 3, 44, 200])
commands = st.one_of(
    st.tuples(st.sampled_from([WILL, WONT, DO, DONT]), options).map(lambda two: bytes([IAC, *two])),
    st.binary(max_size=80).map(
        lambda data: bytes([IAC, SB, COM_PORT]) + data.replace(b"\xff", b"\xff\xff") + bytes([IAC, SE])
    ),
    st.just(bytes([IAC, 241])),
)


@given(st.lists(st.tuples(st.binary(max_size=9), commands), max_size=9), st.lists(st.integers(0, 400), max_size=6))
def test_the_lines_bytes_come_through_however_the_stream_is_cut(parts, cuts):
    stream = b"".join(data.replace(b"\xff", b"\xff\xff") + command for data, command in parts)
    places = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    receiver, whole = TelnetReceiver(), TelnetReceiver()
    heard = b"".join(receiver.feed(stream[low:high]) for low, high in pairwise(places))
    assert heard == b"".join(data for data, _ in parts) == whole.feed(stream)
    assert receiver.replies == whole.replies
    assert receiver.values() == whole.values()


@given(st.lists(st.one_of(st.binary(max_size=40), commands), max_size=30))
def test_no_server_makes_the_tap_send_more_than_telnets_answers(parts):
    receiver = TelnetReceiver()
    for part in parts:
        receiver.feed(part)
    replies = bytes(receiver.replies)
    assert len(replies) % 3 == 0
    for at in range(0, len(replies), 3):
        assert replies[at] == IAC
        assert replies[at + 1] in (WILL, WONT, DO, DONT)


def test_a_block_of_a_port_server_reaches_the_listener(server):
    source = TapSource([PortSettings(server.url)])
    data = b""
    for item in source.items():
        if isinstance(item, PortEvent) and item.kind == "settled":
            server.say(SENT)
        if isinstance(item, Block):
            data += item.data.tobytes()
            if len(data) == len(SENT):
                source.close()
    assert data == SENT
