"""A tap for others: a viewer's frames and times are the tap's, through broken connections, secrets and hostile ends."""

import contextlib
import json
import os
import shutil
import socket
import subprocess
import threading
import time
from functools import partial
from itertools import pairwise, product
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from livebus import Running, eventually, pty
from running import refused, spawned

import captures
from captures import samples
from captures.chunks import Block, Chunk
from captures.line import LineSettings
from captures.live import tapserver
from captures.live.batching import HEAD, POSITION, READS, event_record, position_record, tick_record
from captures.live.tap import PortError
from captures.live.taproom import PLACES, STRANGERS, Rooms, SparingLog, Visitor
from captures.live.tapserver import KeptStream, TapServer
from captures.live.tapstream import (
    VERSION,
    Proving,
    TapAddress,
    TapSetupError,
    hear,
    is_local,
    new_nonce,
    read_token,
    send_line,
    serving_context,
)
from captures.live.tapviewer import TapViewer
from captures.live.wire import PortEvent, Splitter, Tick, WireError, item_of, records_of
from captures.recording.notes import read

LINE = LineSettings(baud=19200, char_bits=11, parity="E", stop_bits=1)
REQUEST = bytes.fromhex("1103006b00037687")
ANSWER = bytes.fromhex("110306ae415652434049ad")
TOKEN = "0123456789abcdef"


def decoded(*record) -> Any:
    """An item of whatever kind."""
    return item_of(*record)


def block(*chunks):
    return Block.from_chunks([Chunk(t_ns, data, port, errors=errors) for t_ns, data, port, errors in chunks])


def same(one, two):
    return [one.chunk(i) for i in range(len(one))] == [two.chunk(i) for i in range(len(two))]


class Heard:
    """What a viewer gets, taken by a thread."""

    def __init__(self, viewer):
        self.viewer, self.items, self.error = viewer, [], None
        self._thread = threading.Thread(target=self._take, daemon=True)
        self._thread.start()

    def _take(self):
        try:
            for item in self.viewer.items():
                self.items.append(item)
        except PortError as error:
            self.error = error

    @property
    def chunks(self):
        return [b.chunk(i) for b in list(self.items) if isinstance(b, Block) for i in range(len(b))]

    def kinds(self):
        return [item.kind for item in list(self.items) if isinstance(item, PortEvent)]

    def words(self):
        return "\n".join(item.text for item in list(self.items) if isinstance(item, PortEvent))

    def end(self):
        self.viewer.close()
        self._thread.join(10)
        assert not self._thread.is_alive()


def told_times(heard, times):
    """Whether it was told so often that the connection is lost."""
    return heard.words().count("connection lost") >= times


def has_chunks(heard, count):
    """Whether so many reads came."""
    return len(heard.chunks) == count


def has_viewers(server, count):
    """Whether so many have a place."""
    return server.viewers == count


@contextlib.contextmanager
def serving(**options):
    """A tap without a port: what it heard is fed by hand. `said` are its words."""
    said: list[str] = []
    server: Any = TapServer("127.0.0.1", options.pop("port", 0), tell=said.append, **options)
    server.said, server.url = said, f"tap://127.0.0.1:{server.port}"
    server.feed(PortEvent(time.time_ns(), 0, "opened", "bus: open", {"tap": "usb"}), LineSettings())
    server.feed(PortEvent(time.time_ns(), 0, "settled", "listening", {}), LINE)
    try:
        yield server
    finally:
        server.close()


@contextlib.contextmanager
def viewing(url, **options):
    heard = Heard(TapViewer(url, **options))
    try:
        assert eventually(lambda: "settled" in heard.kinds() or heard.error is not None)
        yield heard
    finally:
        heard.end()


class Proxy:
    """A way to a tap that can be cut."""

    def __init__(self, port):
        self._to, self.open, self.connections = port, True, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tap://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        with contextlib.suppress(OSError):
            while True:
                near, _ = self.listener.accept()
                if not self.open:
                    near.close()
                    continue
                far = socket.create_connection(("127.0.0.1", self._to))
                self.connections += [near, far]
                for source, target in ((near, far), (far, near)):
                    threading.Thread(target=self._pass_on, args=(source, target), daemon=True).start()

    @staticmethod
    def _pass_on(source, target):
        with contextlib.suppress(OSError):
            while data := source.recv(1000):
                target.sendall(data)
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_RDWR)

    def cut(self):
        self.open = False
        for each in self.connections:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def mend(self):
        self.open = True


def reads(first, count):
    """So many reads, a block each, with times of their own."""
    begin = time.time_ns() + 1_000_000_000
    return [
        block((begin + n * 1_000_003, bytes([n >> 8, n & 255]) + REQUEST, 0, ())) for n in range(first, first + count)
    ]


def test_an_item_is_the_same_after_the_wire():
    items = [
        block((5, REQUEST, 0, (1, 7)), (9, ANSWER, 1, ()), (9, b"\0" * 65_535, 0, (65_534,))),
        Tick(17),
        PortEvent(18, 1, "lost", "ttyUSB0: lost (\x1b[2J)", {"line": {"baud": 9600}}),
    ]
    data = b"".join(record for item in items for record, _ in records_of(item))
    for size in (1, 7, len(data)):
        splitter = Splitter()
        got = [decoded(*record) for at in range(0, len(data), size) for record in splitter.feed(data[at : at + size])]
        assert same(got[0], items[0])
        assert got[1:] == items[1:]


def test_a_long_block_goes_in_several_records():
    long = block(*((n, bytes([n % 256]) * 4000, 0, (n,)) for n in range(200)))
    records = list(records_of(long))
    assert len(records) > 1
    assert sum(octets for _, octets in records) == len(long.data)
    splitter = Splitter()
    parts = [decoded(*record) for data, _ in records for record in splitter.feed(data)]
    assert same(Block.joined(parts), long)


@given(st.binary(max_size=200))
@example(HEAD.pack(READS, 0, 0, 8) + bytes([255]) * 8)
@example(HEAD.pack(READS, 0, 0, 0xFFFFFFFF))
@example(event_record(0, 0, "lost", "text")[:-1] + b"]")
@example(HEAD.pack(3, 0, 0, 20) + b"[" * 20)
@example(HEAD.pack(READS, 0, 0, 8 + 11 + 1) + bytes.fromhex("0100000000000000") + bytes(8) + b"\2\0" + b"\0" + b"a")
def test_any_bytes_are_records_or_an_error_of_one_line(data):
    splitter = Splitter()
    try:
        for record in splitter.feed(data):
            item = decoded(*record)
            if isinstance(item, Block):
                assert [len(item.chunk(i).data) > 0 for i in range(len(item))]
    except WireError as error:
        assert "\n" not in str(error)


@given(st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=5), st.integers(0, 400), st.integers(0, 255))
def test_a_damaged_record_of_reads_is_refused_or_has_columns_that_agree(parts, at, value):
    ((record, _),) = records_of(block(*((n, data, 0, (0,)) for n, data in enumerate(parts))))
    damaged = bytearray(record)
    damaged[HEAD.size + at % (len(record) - HEAD.size)] = value
    try:
        item = decoded(READS, 0, 0, bytes(damaged[HEAD.size :]))
    except WireError:
        return
    assert int(item.offsets[-1]) == len(item.data)
    assert all(item.chunk(i).data for i in range(len(item)))
    assert all(a <= b for a, b in pairwise(item.t_ns.tolist()))


def test_viewers_hear_what_the_tap_heard_with_its_times():
    sent = reads(0, 300)
    with serving() as server, viewing(server.url) as one, viewing(server.url) as two:
        for each in sent:
            server.feed(each, LINE)
        whole = [each.chunk(0) for each in sent]
        assert eventually(lambda: len(one.chunks) == len(two.chunks) == 300)
        assert one.chunks == two.chunks == whole
        assert one.viewer.line == LINE
        with viewing(server.url) as late:
            server.feed(reads(900, 1)[0], LINE)
            assert eventually(lambda: len(late.chunks) == 1)  # from now on, not from the beginning
        assert one.viewer.lost == 0


def test_a_connection_that_breaks_loses_nothing_that_is_kept():
    with serving() as server:
        proxy = Proxy(server.port)
        with viewing(proxy.url) as heard:
            sent = reads(0, 600)
            for turn in range(3):
                for each in sent[200 * turn : 200 * turn + 100]:
                    server.feed(each, LINE)
                proxy.cut()
                for each in sent[200 * turn + 100 : 200 * turn + 200]:
                    server.feed(each, LINE)
                assert eventually(partial(told_times, heard, turn + 1))
                proxy.mend()
                assert eventually(partial(has_chunks, heard, 200 * turn + 200))
            assert heard.chunks == [each.chunk(0) for each in sent]
            assert heard.viewer.lost == 0
            assert heard.words().count("connected again, nothing lost") >= 3
            assert "lost" not in heard.kinds()


def test_what_the_tap_did_not_keep_is_counted_and_told():
    with serving(keep_bytes=20_000) as server:
        proxy = Proxy(server.port)
        with viewing(proxy.url) as heard:
            sent = reads(0, 1001)
            server.feed(sent[0], LINE)
            assert eventually(lambda: len(heard.chunks) == 1)
            proxy.cut()
            assert eventually(lambda: "connection lost" in heard.words())
            for each in sent[1:]:
                server.feed(each, LINE)
            proxy.mend()
            assert eventually(lambda: heard.chunks[-1:] == [sent[-1].chunk(0)])
            got = heard.chunks
            missing = sum(len(each.data) for each in sent) - sum(len(chunk.data) for chunk in got)
            assert missing > 0
            assert heard.viewer.lost == missing
            assert f"{missing:,} bytes are lost" in heard.words()
            first, again = [
                item.t_ns for item in heard.items if isinstance(item, PortEvent) and item.kind in ("lost", "opened")
            ][-2:]
            assert first == got[0].t_ns < again <= got[1].t_ns


def test_a_viewer_that_is_too_slow_is_told_what_it_missed_and_holds_up_nobody():
    with serving(keep_bytes=100_000) as server, viewing(server.url) as quick:
        viewer = TapViewer(server.url)
        items: Any = viewer.items()
        assert next(items).kind == "opened"
        begin = time.time_ns()
        big = [block((begin + n * 1000, bytes(4000), 0, ())) for n in range(5000)]  # more than sockets hold
        for each in big:
            server.feed(each, LINE)
        assert eventually(lambda: quick.chunks and quick.chunks[-1] == big[-1].chunk(0))
        assert sum(len(chunk.data) for chunk in quick.chunks) + quick.viewer.lost == 5000 * 4000
        heard = 0
        for item in items:
            heard += len(item.data) if isinstance(item, Block) else 0
            if isinstance(item, Block) and int(item.t_ns[-1]) == int(big[-1].t_ns[-1]):
                break
        assert viewer.lost > 0
        assert heard + viewer.lost == 5000 * 4000
        items.close()


def test_a_tap_that_begins_anew_is_said_and_its_earlier_clock_does_not_turn_times_back():
    with serving() as server, viewing(server.url) as heard:
        last = block((time.time_ns() + 5_000_000_000, REQUEST, 0, ()))
        server.feed(last, LINE)
        assert eventually(lambda: len(heard.chunks) == 1)
        port = server.port
        server.close()
        with serving(port=port) as again:
            again.feed(block((time.time_ns(), ANSWER, 0, ())), LINE)
            assert eventually(lambda: len(heard.chunks) == 2)
        assert "restarted: bytes in between are unknown" in heard.words()
        times = [chunk.t_ns for chunk in heard.chunks]
        assert times == sorted(times)


def test_a_tap_with_a_token_lets_only_those_in_who_have_it():
    with serving(token=TOKEN) as server:
        with viewing(server.url, token=TOKEN) as heard:
            assert heard.error is None
        for token in (None, TOKEN[:-1] + "x"):
            with viewing(server.url, token=token) as heard:
                assert "refused: this tap needs another token" in str(heard.error)
        assert sum("refused" in words for words in server.said) == 1  # of two alike


def greeted(connection, token=None, session="", **instead):
    """What a tap answers to someone who knows this token; `instead`: other words of his."""
    greeting, _ = hear(connection)
    proving = Proving(token, greeting["nonce"], new_nonce())
    words = {"nonce": proving.viewer_nonce, "proof": proving.proof("viewer", session), "session": session}
    send_line(connection, {**words, "next": None, **instead})
    return hear(connection)[0]


def connected(server):
    return socket.create_connection(("127.0.0.1", server.port), 10)


def test_what_was_overheard_lets_nobody_in():
    with serving(token=TOKEN) as server:
        words = {"nonce": new_nonce()}
        with connected(server) as connection:
            greeting, _ = hear(connection)
            words["proof"] = Proving(TOKEN, greeting["nonce"], words["nonce"]).proof("viewer", "")
            send_line(connection, words)
            assert "session" in hear(connection)[0]
        with connected(server) as connection:
            assert "refused" in greeted(connection, **words)


def test_what_one_side_proves_is_no_proof_of_the_other():
    with serving(token=TOKEN) as server:
        with connected(server) as connection:
            answer = greeted(connection, TOKEN)
        for proof in (answer["proof"], None, 7, "", "\ud800"):
            with connected(server) as connection:
                assert "refused" in greeted(connection, TOKEN, proof=proof)


@pytest.mark.parametrize(
    ("token", "theirs"), [(TOKEN, None), (TOKEN, TOKEN[:-1] + "x"), (TOKEN, "replayed"), (TOKEN, "its own back")]
)
def test_a_tap_that_does_not_know_the_token_is_refused_and_nothing_of_it_is_taken(token, theirs):
    tap = HostileTap(BEGIN + tick_record(2000), token=theirs)
    heard = Heard(TapViewer(tap.url, token=token))
    try:
        assert eventually(lambda: heard.error is not None)
        assert "it failed to prove that it knows the token" in str(heard.error)
        assert heard.items == []
    finally:
        heard.end()


def test_a_fake_tap_in_the_place_of_one_that_went_is_told_and_never_recorded():
    with serving(token=TOKEN) as server, viewing(server.url, token=TOKEN) as heard:
        server.feed(reads(0, 1)[0], LINE)
        assert eventually(lambda: len(heard.chunks) == 1)
        server.close()
        fake = HostileTap(BEGIN + b"".join(data for data, _ in records_of(reads(1, 1)[0])), port=server.port)
        assert eventually(lambda: "it failed to prove that it knows the token" in heard.words())
        assert fake.connections
        assert len(heard.chunks) == 1
        assert "opened" not in heard.kinds()[2:]
        fake.listener.close()


def test_who_has_proved_nothing_keeps_nobody_out():
    """Not as many as there are places, nor more, with a token or without."""
    for token in (None, TOKEN):
        with serving(token=token) as server:
            silent = [connected(server) for _ in range(3 * PLACES + STRANGERS)]
            assert server.viewers == 0
            with contextlib.ExitStack() as stack:
                viewers = [stack.enter_context(viewing(server.url, token=token)) for _ in range(PLACES)]
                assert [each.error for each in viewers] == [None] * PLACES
                assert eventually(partial(has_viewers, server, PLACES))
                with viewing(server.url, token=token) as late:
                    assert f"refused: all {PLACES} viewer slots of this tap are taken" in str(late.error)
            assert sum("too many unauthenticated connections" in words for words in server.said) == 1
            assert sum("viewer slots of this tap are taken" in words for words in server.said) == 1
            for each in silent:
                each.close()


def test_of_a_crowd_of_strangers_the_one_with_the_most_connections_gives_way():
    rooms, here = Rooms(places=1, strangers=3), [Visitor(socket.socket(), name) for name in ("a", "b", "b", "a")]
    with contextlib.ExitStack() as stack:
        for each in here:
            stack.enter_context(each.connection)
            rooms.enter(each)
        assert [bool(each.why) for each in here] == [False, True, False, False]
        assert not rooms.admit(here[1])
        assert rooms.admit(here[0]) and not rooms.admit(here[2])
        rooms.leave(here[0])
        assert rooms.admit(here[2])
    network = [Visitor(here[0].connection, address).origin for address in ("2001:db8::1", "2001:db8::2", "::1")]
    assert network[0] == network[1] != network[2]


def test_a_tap_or_viewer_of_another_version_is_told_as_that():
    tap = HostileTap(b"", version=1)
    heard = Heard(TapViewer(tap.url))
    assert eventually(lambda: heard.error is not None)
    assert f"the tap has version 1, this is version {VERSION}: update the older" in str(heard.error)
    heard.end()
    with serving() as server, connected(server) as connection:
        greeting, _ = hear(connection)
        assert greeting["rtuscope_tap"] == VERSION
        send_line(connection, {"proof": "", "session": "", "next": None})  # as viewers of version 1 did
        assert "not a viewer of this version" in hear(connection)[0]["refused"]


def test_what_strangers_cause_does_not_fill_the_log():
    said: list[str] = []
    log = SparingLog(said.append)
    for _ in range(1000):
        log("192.0.2.1", "refused: a")
    log("192.0.2.1", "refused: b")
    assert said == ["viewer at 192.0.2.1: refused: a", "viewer at 192.0.2.1: refused: b"]


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificate, and is not here")
def test_with_tls_the_tap_is_known_by_its_certificate(tmp_path):
    for name in ("tap", "other"):
        subprocess.run(
            ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=tap",
             "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", f"{name}.key", "-out", f"{name}.pem"],
            cwd=tmp_path, check=True, capture_output=True,
        )  # fmt: skip
    tls = serving_context(str(tmp_path / "tap.pem"), str(tmp_path / "tap.key"))
    with serving(token=TOKEN, tls=tls) as server:
        url = server.url.replace("tap://", "taps://")
        with viewing(url, token=TOKEN, authority=str(tmp_path / "tap.pem")) as heard:
            sent = reads(0, 50)
            for each in sent:
                server.feed(each, LINE)
            assert eventually(lambda: len(heard.chunks) == 50)
        for authority in (None, str(tmp_path / "other.pem")):
            with viewing(url, token=TOKEN, authority=authority) as heard:
                assert "its certificate is not trusted: self" in str(heard.error)
                assert "--tls-ca FILE" in str(heard.error)
        with viewing(server.url, token=TOKEN) as heard:  # without TLS
            assert str(heard.error).endswith("; with TLS it is taps://")
    with (
        serving(token=TOKEN) as server,
        viewing(server.url.replace("tap://", "taps://"), token=TOKEN, authority=str(tmp_path / "tap.pem")) as heard,
    ):
        assert str(heard.error).endswith("; without TLS it is tap://")
    with pytest.raises(TapSetupError, match="not a PEM certificate with its key"):
        serving_context(str(tmp_path / "tap.pem"), str(tmp_path / "other.key"))


@pytest.mark.parametrize(
    "hello",
    [b"", b"GET / HTTP/1.1\r\n\r\n", b"\0" * 20_000, b"[" * 4000 + b"\n", b'{"session": {}, "next": -1e400}\n', b"3\n"],
)
def test_a_viewer_that_says_nonsense_costs_nobody_anything(hello):
    with serving() as server, viewing(server.url) as heard:
        with socket.create_connection(("127.0.0.1", server.port)) as connection, contextlib.suppress(OSError):
            connection.settimeout(0.3)  # one whose line is one is let in
            connection.sendall(hello)
            connection.shutdown(socket.SHUT_WR)
            while connection.recv(1000):
                pass
        server.feed(reads(0, 1)[0], LINE)
        assert eventually(lambda: len(heard.chunks) == 1)

        def alone():
            server.feed(Tick(time.time_ns() + 10**10), LINE)  # who is gone is noticed when there is something to send
            return server.viewers == 1

        assert eventually(alone)


def test_who_connects_and_says_nothing_is_let_go(monkeypatch):
    monkeypatch.setattr(tapserver, "HELLO_S", 0.2)
    with serving() as server:
        drip = connected(server)
        assert drip.recv(1000)
        with contextlib.suppress(OSError):
            while True:  # a byte now and then
                drip.sendall(b"[")
                time.sleep(0.02)
        assert any("refused: the token was not confirmed in time" in words for words in server.said)
        silent = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(40)]
        for each in silent:
            each.settimeout(10)
            with each, contextlib.suppress(ConnectionError):
                while each.recv(1000):  # the greeting, then the end
                    pass
        monkeypatch.undo()
        with viewing(server.url) as heard:
            assert heard.error is None


class HostileTap:
    """A tap that greets as one should, then sends these bytes to each who comes."""

    def __init__(self, stream, *, token=None, version=VERSION, port=0, silent=False, stays=False):
        """`token`: it knows this one; or what it does instead of knowing it. `silent`: it does not even greet."""
        self._silent, self._stays = silent, stays
        self._stream, self._token, self._version, self.connections = stream, token, version, 0
        self.listener = socket.create_server(("127.0.0.1", port))
        self.url = f"tap://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self.listener.accept()
                self.connections += 1
                with connection, contextlib.suppress(OSError, WireError):
                    if self._silent:
                        connection.recv(1)
                    send_line(connection, {"rtuscope_tap": self._version, "nonce": "00" * 16})
                    asked, _ = hear(connection)
                    right = Proving(self._token, "00" * 16, asked["nonce"]).proof("tap", "x")
                    of_other = Proving(TOKEN, "00" * 16, "11" * 16).proof("tap", "x")
                    instead = {"replayed": of_other, "its own back": asked["proof"]}
                    send_line(connection, {"session": "x", "proof": instead.get(self._token, right)})
                    connection.sendall(self._stream)
                    if self._stays:
                        connection.recv(1)
                    time.sleep(0.2)


BEGIN = position_record(1000, {"next": 0, "heard": 0, "line": None})
HOSTILE = {
    "no position": tick_record(5),
    "a huge record": BEGIN + HEAD.pack(READS, 0, 0, 0xFFFFFFF0),
    "a time out of range": BEGIN + HEAD.pack(2, 0, -(1 << 63), 0),
    "times that go back": BEGIN + tick_record(2000) + tick_record(1999),
    "a position that is none": position_record(0, {"next": "0", "heard": 1 << 80}),
    "no JSON": HEAD.pack(POSITION, 0, 0, 3) + b"\xff\xfe{",
    "reads without any": BEGIN + HEAD.pack(READS, 0, 0, 8) + bytes(8),
}


@pytest.mark.parametrize("stream", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_tap_is_left_and_told_in_a_line(stream):
    tap = HostileTap(stream)
    heard = Heard(TapViewer(tap.url))
    try:
        assert eventually(lambda: tap.connections > 1)
        assert "its data is not a tap's" in heard.words()
        assert all("\n" not in each.text for each in heard.items if isinstance(each, PortEvent))
        assert heard.error is None
    finally:
        heard.end()


def test_settings_and_words_of_a_hostile_tap_are_taken_as_far_as_they_are_possible():
    line = {"baud": 10**30, "parity": ["E"], "note": {"a": [1]}, "char_bits": 11}
    words = event_record(1500, 0, "failed\n", "\x1b[2J" + "x" * 100_000, tap=["usb"], settings=7)
    tap = HostileTap(position_record(1000, {"next": 0, "heard": 0, "line": line}) + words + tick_record(2000))
    heard = Heard(TapViewer(tap.url))
    try:
        assert eventually(lambda: any(isinstance(item, Tick) for item in heard.items))
        assert heard.viewer.line.baud is None
        assert heard.viewer.line.char_bits == 11
        told = next(item for item in heard.items if isinstance(item, PortEvent) and item.t_ns == 1500)
        assert told.kind == "notice"
        assert len(told.text) == 1000
    finally:
        heard.end()


def test_the_oldest_is_given_up_and_memory_stays_bounded():
    history = KeptStream(50_000)
    for each in reads(0, 2000):
        history.add(each, LINE)
    number, position = history.position(0)
    (record,) = Splitter().feed(position)
    told = json.loads(record[3])
    assert told["next"] == number > 1500
    assert told["heard"] == number * (2 + len(REQUEST))
    assert history.take_records(0, 0) is None
    assert sum(map(len, history.take_records(number, 0) or [])) < 50_000


@pytest.mark.parametrize(
    ("url", "host", "port"),
    [("tap://bus", "bus", 9616), ("TAP://10.0.0.2:7", "10.0.0.2", 7), ("taps://[::1]", "::1", 9616)],
)
def test_addresses_of_taps(url, host, port):
    address = TapAddress.of(url)
    assert (address.host, address.port, address.tls) == (host, port, url.startswith("taps"))


@pytest.mark.parametrize("url", ["tap://", "tap://bus:x", "tap://bus:99999", "tap://secret@bus", "tap://bus/x?token=1"])
def test_what_is_no_address_of_a_tap_is_said(capsys, url):
    assert "not a tap address" in refused(capsys, "sniff", url)


def test_what_is_local():
    assert is_local("127.0.0.1") and is_local("::1") and is_local("127.8.0.1")
    assert not (is_local("0.0.0.0") or is_local("::") or is_local("192.0.2.1") or is_local(""))


def test_a_tap_that_others_reach_wants_a_token(capsys, tmp_path, monkeypatch):
    monkeypatch.delenv("RTUSCOPE_TAP_TOKEN", raising=False)
    for host in ("0.0.0.0", "[::]", "192.0.2.1"):
        assert "open to other machines: give --token-file" in refused(capsys, "tap", "/dev/x", "--listen", f"{host}:0")
    short = tmp_path / "token"
    short.touch(0o600)
    short.write_text("secret\n")
    assert "at least 16 characters" in refused(capsys, "tap", "/dev/x", "--token-file", short)
    assert "cannot be read" in refused(capsys, "tap", "/dev/x", "--token-file", tmp_path / "none")
    assert "--tls-cert" in refused(capsys, "tap", "/dev/x", "--tls-key", short)
    assert "this is a tap already" in refused(capsys, "tap", "tap://bus")
    assert "--port2" in refused(capsys, "sniff", "tap://bus", "--port2", "/dev/x")


@pytest.mark.skipif(os.name != "posix", reason="modes are POSIX")
@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o620, 0o666])
def test_a_token_that_others_may_read_is_refused(capsys, tmp_path, mode):
    token = tmp_path / "token"
    token.write_text(TOKEN)
    token.chmod(mode)
    for command in (("tap", "/dev/x"), ("sniff", "tap://127.0.0.1:1")):
        told = refused(capsys, *command, "--token-file", token)
        assert f"others can read it (mode {mode:04o})" in told and f"chmod 600 {token}" in told
    token.chmod(0o400)
    assert read_token(str(token)) == TOKEN
    assert "no tap there: connection refused" in refused(capsys, "sniff", "tap://127.0.0.1:1")


def test_viewers_are_told_of_no_tap_whose_port_is_not_there():
    done = spawned("tap", "/dev/not-there", "--listen", "0")
    assert done.status == 2
    assert done.err.splitlines() == ["rtuscope: /dev/not-there: no such port; `rtuscope ports` lists the ports"]


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
def test_recordings_made_at_the_tap_and_by_viewers_have_the_same_frames(tmp_path):
    master, name = pty()
    token = tmp_path / "token"
    token.touch(0o600)
    token.write_text(TOKEN)
    tap = Running("tap", name, "--baud", "115200", "--listen", "0", "--token-file", token)
    said = b"".join(tap.said).decode()
    url = next(word for word in said.split() if word.startswith("tap://"))
    viewers = [Running("record", url, "-o", tmp_path / f"{n}.mcap", "--token-file", token) for n in range(2)]
    sniff = Running("sniff", url, "--json", "--token-file", token, reads=True)
    count = 60
    for _ in range(count):
        os.write(master, REQUEST)
        time.sleep(0.004)
        os.write(master, ANSWER)
        time.sleep(0.012)
    assert eventually(lambda: sniff.out.count(b'"direction":') >= 2 * count)
    statuses = [each.ended() for each in (*viewers, sniff)]
    assert [status for status, *_ in statuses] == [0, 0, 130] or [status for status, *_ in statuses] == [0, 0, 0]
    status, _, words = tap.ended()
    assert status == 0
    assert f"{count * (len(REQUEST) + len(ANSWER)):,} bytes received" in words
    one, two = ([*captures.open(tmp_path / f"{n}.mcap").chunks()] for n in range(2))
    assert one == two
    assert b"".join(chunk.data for chunk in one) == (REQUEST + ANSWER) * count
    assert captures.open(tmp_path / "0.mcap").line.baud == 115200
    assert [note.kind for note in read(tmp_path / "0.mcap")][:2] == ["opened", "settled"]
    os.set_blocking(master, False)
    with pytest.raises(BlockingIOError):  # nothing was ever sent to the bus
        os.read(master, 100)


@pytest.mark.parametrize(
    ("command", "tap"),
    [
        *product(("sniff", "record", "sniff recording"), ("away", "mute", "greets and is mute")),
        *product(("tap", "replay", "replay onto a port"), ("none",)),
    ],
)
def test_a_duration_ends_whatever_does_not_come(tmp_path, command, tap):
    """By the machine's clock: nothing that would tell the time comes."""
    record, device = ["-o", tmp_path / "bus.mcap"], ["/dev/not-there", "--wait"]
    mute = HostileTap(BEGIN, silent=tap == "mute", stays=True)
    url = "tap://127.0.0.1:1" if tap == "away" else mute.url
    words = {
        "sniff": ["sniff", url, "--wait"],
        "record": ["record", url, "--wait", *record],
        "sniff recording": ["sniff", url, "--wait", *record],
        "tap": ["tap", *device, "--listen", "0"],
        "replay": ["replay", samples.path("troubled.jsonl"), "--speed", "0.001"],
        "replay onto a port": ["replay", samples.path("troubled.jsonl"), "--speed", "0.001", "--to", "loop://"],
    }[command]
    try:
        done = spawned(*words, "--duration", "0.4s")
    finally:
        mute.listener.close()
    assert done.status in (0, 1), done
    assert "Traceback" not in done.err and "defect" not in done.err
