"""The reader's wait: a terminal is told each time that more came, and kept in sight, however much comes at once."""

import os
import threading

import pytest
from livebus import pty, raw_pty

from captures.chunks import Block
from captures.live.listening import Listening
from captures.live.reader import Waiting
from captures.live.settings import PortSettings

pytestmark = pytest.mark.skipif(os.name != "posix", reason="descriptors are waited for on POSIX")
_PATIENCE_S = 5.0


def test_a_terminal_is_told_each_time_that_more_came():
    master, slave = raw_pty()
    waiting = Waiting([slave], [], [])
    for data in (b"\x01", b"\x02\x03"):
        os.write(master, data)
        assert waiting.ready(_PATIENCE_S) == [slave]
        assert os.read(slave, 4096) == data
        assert waiting.ready(0) == []
    waiting.close()
    os.close(master)
    os.close(slave)


def test_a_terminal_that_hung_up_is_told_until_it_is_let_go_of():
    master, slave = raw_pty()
    waiting = Waiting([slave], [], [])
    os.close(master)
    for _ in range(3):
        assert waiting.ready(_PATIENCE_S) == [slave]
    waiting.close()
    os.close(slave)


def test_what_is_no_terminal_is_told_as_long_as_there_is_something():
    out, into = os.pipe()
    waiting = Waiting([], [out], [into])
    assert waiting.ready(_PATIENCE_S) == [into]
    os.write(into, b"ab")
    for _ in range(2):
        assert sorted(waiting.ready(_PATIENCE_S)) == sorted([out, into])
    waiting.close()
    os.close(out)
    os.close(into)


def test_all_of_a_burst_comes_that_is_more_than_a_terminal_keeps():
    master, name = pty()
    sent = os.urandom(60_000)

    def talk():
        left = memoryview(sent)
        while left:
            left = left[os.write(master, left[:3000]) :]

    came = b""
    with Listening([PortSettings(name)]) as listening:
        for item in listening.items():
            if isinstance(item, Block):
                came += item.data.tobytes()
            elif getattr(item, "kind", "") == "opened":
                threading.Thread(target=talk).start()
            if len(came) >= len(sent):
                listening.close()
    assert came == sent
