"""Taps as a session's source: settings that are sought while bytes come, and two taps that were mixed up."""

import pytest
from buses import adu
from uart import received, wave

from analyzer.live import tapsource
from analyzer.live.session import Session
from analyzer.live.tapsource import TapSource
from analyzer.tables.schema import Kind, Rows
from captures.chunks import Block, Chunk
from captures.live.settings import PortSettings
from captures.live.wire import PortEvent, Tick

POLL, VALUES = adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")
ECHO = adu("110600010005")


class Listening:
    """In place of the reader's process: `script` gives what is heard with the settings of the moment."""

    script = staticmethod(lambda _: ())
    more = False

    def __init__(self, ports, **_):
        self.ports, self.asked = list(ports), []

    def change(self, port, settings):
        self.asked.append((port, settings))

    def items(self):
        yield PortEvent(0, 0, "opened", "open", {"tap": "usb", "back": False})
        script = iter(self.script(self))
        while True:
            for port, settings in self.asked:
                self.ports[port] = settings
                yield PortEvent(0, port, "settings", "", {})
            self.asked = []
            try:
                yield next(script)
            except StopIteration:
                return

    def close(self):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.fixture
def scripted(monkeypatch):
    """Let a source hear what a script says."""

    def use(script):
        monkeypatch.setattr(Listening, "script", staticmethod(script))
        monkeypatch.setattr(tapsource, "Listening", Listening)
        monkeypatch.setattr(TapSource, "waits", True)  # a bus that does not run ahead of the analysis

    return use


def bus(*lines, rounds=12):
    """A script: the same polls over and over, on a line that has these settings one after the other."""

    def script(listening):
        now = 10**18
        for line in lines:
            said = [(0.01 + 0.06 * n, data) for n, data in enumerate((POLL, VALUES) * 3)]
            levels = wave(said, line)
            for _ in range(rounds):
                heard = received(levels, listening.ports[0], start_ns=now)
                now += 2 * 10**9
                if len(heard):
                    yield heard
                yield Tick(now)

    return script


def test_settings_are_sought_then_all_that_was_heard_with_them_is_given(scripted):
    scripted(bus(PortSettings("tap", 19200, "E")))
    with Session(TapSource([PortSettings("tap")])) as session:
        steps = list(session.steps())
    rows = Rows.joined([step.batch.rows for step in steps])
    kinds = [event.kind for step in steps for event in step.events]
    assert kinds[:2] == ["opened", "seeking"]
    assert "trying" in kinds
    assert kinds.count("settled") == 1
    assert (session.line.baud, session.line.parity, session.line.char_bits, session.line.tap) == (19200, "E", 11, "usb")
    assert rows.check.all()
    assert len(rows) >= 6 * 10


def test_time_passes_on_a_silent_line_while_its_settings_are_sought(scripted):
    ticks = [Tick(10**18 + n * 10**9) for n in range(3)]
    scripted(lambda _: ticks)
    assert [item for item in TapSource([PortSettings("tap")]).items() if isinstance(item, Tick)] == ticks


def test_settings_that_make_no_sense_any_more_are_sought_anew(scripted):
    before, after = PortSettings("tap", 9600, "N"), PortSettings("tap", 38400, "E")
    scripted(bus(before, *[after] * 2, rounds=40))
    with Session(TapSource([PortSettings("tap")])) as session:
        steps = list(session.steps())
    settled = [event.text for step in steps for event in step.events if event.kind == "settled"]
    assert [text.split("listening with ")[1] for text in settled] == ["9600 8N1", "38400 8E1"]
    assert session.line.baud == 38400
    assert steps[-3].batch.rows.check.all()


def test_what_is_told_late_of_settings_that_were_left_is_no_doubt_of_new_ones(scripted):
    scripted(bus(PortSettings("tap", 38400, "E"), rounds=80))
    source = TapSource([PortSettings("tap")])
    left, told = source.line, []
    for item in source.items():
        if isinstance(item, PortEvent):
            told.append(item.kind)
        elif "settled" in told and told.count("late") < 10:
            told.append("late")
            source.judge(500, 0, left)
            if told.count("late") == 10:
                source.judge(500, 0, source.line)
    words = " ".join(told).split(" settled ", 1)[1]
    assert words.startswith(" ".join(["late"] * 10) + " seeking ")


def test_a_rate_that_was_given_is_kept_whatever_is_heard(scripted):
    scripted(bus(PortSettings("tap", 38400, "E"), rounds=40))
    with Session(TapSource([PortSettings("tap", 9600, "N")])) as session:
        kinds = [event.kind for step in session.steps() for event in step.events]
    assert kinds == ["opened", "settled"]
    assert session.line.baud == 9600


@pytest.mark.parametrize("client", [0, 1])
def test_what_each_of_two_taps_hears_is_known_and_a_wrong_guess_is_mended(scripted, client):
    def script(_):
        now = 10**18
        for request, response in [(POLL, VALUES), (ECHO, ECHO)] * 200:
            for port, data in ((client, request), (1 - client, response)):
                now += 8_000_000
                yield Block.from_chunks([Chunk(now, data, port)])
            yield Tick(now + 8_000_000)

    scripted(script)
    with Session(TapSource([PortSettings("one", 19200), PortSettings("two", 19200)])) as session:
        rows = Rows.joined([step.batch.rows for step in session.steps()])
    last = rows[-100:]
    assert (last.kind != Kind.NOISE).all()
    assert ((last.kind == Kind.REQUEST) == (last.port == client)).all()
    assert (last.request[last.kind == Kind.RESPONSE] >= 0).all()
    assert session.line.notes["directions"] == ("request,response" if client == 0 else "response,request")
