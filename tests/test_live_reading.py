"""Taps: what is read, when, with which errors; that nothing is ever written; that an adapter may come and go."""

import os
import select
import socket
import subprocess
import sys
import threading
import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from livebus import eventually, pty, raw_pty
from running import environment

from captures.chunks import Block
from captures.live.batching import event_record, reads_record, tick_record
from captures.live.listening import Listening
from captures.live.ports import ports
from captures.live.settings import PortSettings
from captures.live.tap import DeviceTap, PortError, Unmarked
from captures.live.wire import Decoder, PortEvent, Tick

posix = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
octets = st.lists(st.tuples(st.sampled_from([0, 1, 0x41, 0xFE, 0xFF]), st.booleans()), max_size=40)


def marked(line):
    """What a driver with PARMRK gives for bytes, some of them with errors."""
    return b"".join(b"\xff\0" + bytes([b]) if bad else b"\xff\xff" if b == 0xFF else bytes([b]) for b, bad in line)


@given(octets, st.lists(st.integers(0, 120), max_size=8))
def test_error_marks_are_taken_out_wherever_a_read_cuts_them(line, cuts):
    raw, unmarked = marked(line), Unmarked()
    places = [0, *sorted(min(cut, len(raw)) for cut in cuts), len(raw)]
    data, errors = b"", []
    for low, high in pairwise(places):
        part, wrong = unmarked.feed(raw[low:high])
        errors += [len(data) + at for at in wrong]
        data += part
    assert data == bytes(b for b, _ in line)
    assert errors == [i for i, (_, bad) in enumerate(line) if bad]


@given(st.binary(max_size=60))
def test_bytes_that_are_no_marks_are_never_lost_twice(raw):
    data, errors = Unmarked().feed(raw)
    assert len(data) <= len(raw)
    assert all(0 <= at < len(data) for at in errors)


@given(
    st.lists(st.tuples(st.binary(min_size=1, max_size=9), st.integers(0, 1)), max_size=12),
    st.integers(1, 5),
    st.integers(1, 40),
)
def test_records_come_through_a_pipe_however_it_cuts_them(reads, gathered, size):
    sent = [(at * 1000, port, data, [len(data) - 1] * (at % 2)) for at, (data, port) in enumerate(reads)]
    records = [reads_record(sent[at : at + gathered]) for at in range(0, len(sent), gathered)]
    stream = b"".join([*records, tick_record(10**6), event_record(10**6, 1, "lost", "gone", more=3)])
    decoder = Decoder()
    items = [item for at in range(0, len(stream), size) for item in decoder.feed(stream[at : at + size])]
    blocks = [item for item in items if isinstance(item, Block)]
    chunks = [block.chunk(i) for block in blocks for i in range(len(block))]
    assert [(c.t_ns, c.port, c.data, c.errors) for c in chunks] == [
        (at * 1000, port, data, (len(data) - 1,) * (at % 2)) for at, (data, port) in enumerate(reads)
    ]
    assert [item for item in items if not isinstance(item, Block)] == [
        Tick(10**6), PortEvent(10**6, 1, "lost", "gone", {"more": 3}),
    ]  # fmt: skip


class Heard:
    """What came so far, for those who must wait for it: a busy machine's reader may be late by any time."""

    def __init__(self):
        self.items, self.data = [], bytearray()

    def add(self, item):
        self.items.append(item)
        if isinstance(item, Block):
            self.data += item.data.tobytes()

    def waits(self, count):
        """Until so many bytes came."""
        assert eventually(lambda: len(self.data) >= count)

    def opened(self, times):
        """Until ports were opened so often."""
        assert eventually(lambda: sum(isinstance(i, PortEvent) and i.kind == "opened" for i in self.items) >= times)


def heard(listening, talk, *, until=b""):
    """All items from a tap while `talk(so_far)` runs; it ends when `until` was heard, or when `talk` is over."""
    so_far = Heard()

    def talking():
        so_far.opened(1)
        talk(so_far)
        if not until:
            listening.close()

    thread = threading.Thread(target=talking)
    thread.start()
    for item in listening.items():
        so_far.add(item)
        if until and so_far.data.endswith(until):
            listening.close()
    thread.join()
    return so_far.items


def joined(items):
    return Block.joined([item for item in items if isinstance(item, Block)])


@posix
@pytest.mark.parametrize("blocking", [False, True])
def test_every_byte_comes_with_the_time_of_its_read(blocking):
    master, name = pty()
    sent = []

    def talk(so_far):
        for number in range(12):
            sent.append(time.time_ns())
            os.write(master, bytes([number, 0xFF, 0x00]))
            so_far.waits(3 * number + 3)

    with Listening([PortSettings(name, 19200)], blocking=blocking) as listening:
        block = joined(heard(listening, talk))
    assert block.data.tobytes() == b"".join(bytes([number, 0xFF, 0x00]) for number in range(12))
    assert (np.diff(block.t_ns) >= 0).all()
    for t_ns, before, after in zip(block.t_ns.tolist(), sent, [*sent[1:], time.time_ns()], strict=True):
        assert before - 2_000_000 <= t_ns <= after + 2_000_000  # what the anchor to the wall clock is worth


@posix
def test_silence_is_told_soon_after_the_last_byte_and_never_before_bytes_that_came():
    master, name = pty()

    def talk(_):
        for _ in range(3):
            os.write(master, b"\x01\x02\x03")
            time.sleep(0.3)

    with Listening([PortSettings(name)], quiet_ns=8_000_000, idle_ns=40_000_000) as listening:
        items = heard(listening, talk)
    times = [int(i.t_ns[-1]) if isinstance(i, Block) else i.t_ns for i in items if not isinstance(i, PortEvent)]
    assert times == sorted(times)
    for number, item in enumerate(items):
        if isinstance(item, Block):
            ticks = [i.t_ns - int(item.t_ns[-1]) for i in items[number + 1 : number + 3]]
            assert ticks[0] >= 8_000_000
            assert ticks[1] >= 40_000_000


@posix
def test_two_taps_are_merged_by_time():
    (first, one), (second, two) = pty(), pty()

    def talk(so_far):
        so_far.opened(2)
        for number in range(5):
            os.write(first, b"ask")
            so_far.waits(9 * number + 3)
            os.write(second, b"answer")
            so_far.waits(9 * number + 9)

    with Listening([PortSettings(one), PortSettings(two)]) as listening:
        block = joined(heard(listening, talk))
    assert block.port.tolist() == [0, 1] * 5
    assert (np.diff(block.t_ns) > 0).all()
    assert block.data.tobytes() == b"askanswer" * 5


@posix
@pytest.mark.parametrize("blocking", [False, True])
def test_a_tap_never_writes_a_byte(blocking):
    master, name = pty()
    with Listening([PortSettings(name, 9600)], blocking=blocking) as listening:
        heard(listening, lambda so_far: (os.write(master, b"\x01\x03\x00\x00\xff\x11\x13" * 50), so_far.waits(350)))
    assert not select.select([master], [], [], 0)[0]  # nothing stands there to be read


@posix
def test_the_kernel_refuses_a_write_through_a_tap():
    _, name = pty()
    tap = DeviceTap(PortSettings(name, 9600))
    assert tap.descriptor is not None
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.write(tap.descriptor, b"x")
    tap.close()


@posix
@pytest.mark.parametrize("blocking", [False, True])
def test_an_adapter_that_is_unplugged_comes_back_by_itself(tmp_path, blocking):
    link = tmp_path / "ttyUSB0"
    plugged = []

    def plug():
        pair = raw_pty()
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(pair[1]))
        plugged.append(pair)

    def unplug():
        link.unlink()
        for descriptor in plugged[-1]:
            os.close(descriptor)

    def talk(so_far):
        os.write(plugged[0][0], b"before")
        so_far.waits(6)
        unplug()
        time.sleep(0.3)
        plug()
        so_far.opened(2)
        os.write(plugged[1][0], b"after")

    plug()
    with Listening([PortSettings(str(link), 9600)], blocking=blocking) as listening:
        items = heard(listening, talk, until=b"after")
    kinds = [item.kind for item in items if isinstance(item, PortEvent) and item.kind != "notice"]
    assert [kind for kind in kinds if kind != "waiting"] == ["opened", "lost", "opened"]
    assert joined(items).data.tobytes() == b"beforeafter"
    unplug()


def test_a_gateways_socket_is_a_tap():
    server = socket.create_server(("127.0.0.1", 0))
    url = f"socket://127.0.0.1:{server.getsockname()[1]}"

    def talk(_):
        connection, _ = server.accept()
        connection.sendall(b"\x01\x03\xff\x00")
        time.sleep(0.1)
        connection.close()

    for blocking in (False, True):
        with Listening([PortSettings(url)], blocking=blocking) as listening:
            items = heard(listening, talk, until=b"\xff\x00")
        assert joined(items).data.tobytes() == b"\x01\x03\xff\x00"
    server.close()


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("/dev/no-such-port", "no such port"),
        (__file__, "a file, not a serial port: view a capture with `rtuscope open`"),
        ("nothing://here", "cannot listen to nothing://"),
        ("loop://", "cannot listen to loop://"),
        ("tcp://10.0.0.7", "rfc2217://HOST:PORT, tap://HOST"),
        ("socket://127.0.0.1", "expected socket://HOST:PORT"),
        ("socket://127.0.0.1:1", "refused"),
    ],
)
def test_a_port_that_is_none_is_refused_in_one_line(url, words):
    with Listening([PortSettings(url)]) as listening, pytest.raises(PortError) as refused:
        list(listening.items())
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


@posix
def test_a_port_that_another_program_holds_is_said_to_be_in_use():
    _, name = pty()
    with Listening([PortSettings(name)]) as first:
        event = next(first.items())
        assert isinstance(event, PortEvent) and event.kind == "opened"
        with Listening([PortSettings(name)]) as second, pytest.raises(PortError, match="in use by another program"):
            list(second.items())


def test_ports_are_listed_with_what_is_known():
    for port in ports():
        assert set(port.to_json()) >= {"device", "description", "usb", "serial", "driver", "latency_ms", "used_by"}


def test_what_runs_everywhere_needs_nothing_of_posix():
    """On Windows there is no termios, no fcntl; nothing may import them before it knows where it is."""
    code = (
        "import sys, types; "
        "sys.modules.update(termios=None, fcntl=None, tty=None, serial=types.ModuleType('serial')); "
        "import captures.live.reader, captures.live.listening, captures.live.ports, captures.recording.recorder, "
        "analyzer.live.tapsource, analyzer.live.session, analyzer.cli.sniff, analyzer.cli.record, analyzer.cli.replay, "
        "analyzer.cli.ports, analyzer.cli.repair, analyzer.cli.terminal"
    )
    done = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()


def test_the_process_that_reads_is_small():
    """It is there beside the analysis, for weeks: what only analyses is not in it."""
    code = "import captures.live.reader, sys; assert not {'numpy', 'mcap', 'analyzer'} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
