"""The analysis while a bus goes on gives what it gives on the whole file; what it had to miss is counted and placed."""

import itertools
import threading

import pytest
from buses import LINE, adu, spaced, streams
from hypothesis import given, settings

import captures
from analyzer.core import Analysed, Analyzer, analyse, deframe
from analyzer.live import session as live_session
from analyzer.live.session import Session
from analyzer.tables.findings import Findings, described
from analyzer.tables.schema import Kind, Rows
from captures import samples
from captures.chunks import Block, Capture, Chunk
from captures.line import LineSettings
from captures.live.wire import PortEvent, Tick

POLL = [adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")]
COLUMNS = [
    "index",
    "start",
    "length",
    "t_start_ns",
    "t_end_ns",
    "request",
    "request_start",
    "kind",
    "unit",
    "check",
    "port",
]


def rows_of(parts):
    return Rows.joined([part.batch.rows for part in parts])


class Watched:
    """An analyzer, and whoever looks at what is certain by now; `settled` is what it gave when all was said."""

    def __init__(self, line):
        self.analyzer = Analyzer(line)
        self.settled = []

    def __getattr__(self, name):
        def called(*arguments):
            self.settled += getattr(self.analyzer, name)(*arguments)
            return self.analyzer.latest

        return called


def live(capture):
    """A capture fed read by read, with the ticks that a tap gives."""
    feed = Watched(capture.line)
    chunks = list(capture.chunks())
    for chunk, after in itertools.zip_longest(chunks, chunks[1:]):
        yield feed.feed(Block.from_chunks([chunk]))
        for wait in (8_000_000, 50_000_000):
            if after is None or chunk.t_ns + wait < after.t_ns:
                yield feed.tick(chunk.t_ns + wait)
    yield feed.close()


@pytest.mark.parametrize("sample", ["healthy.jsonl", "troubled.jsonl", "mbpoll.mcap"])
def test_live_rows_are_those_of_the_file(sample):
    capture = captures.open(samples.path(sample))
    mine = rows_of(live(capture))
    theirs = Rows.joined([batch.rows for batch in deframe(capture)])
    for name in COLUMNS:
        assert mine.column(name).tolist() == theirs.column(name).tolist(), name


@settings(max_examples=30, deadline=None)
@given(streams())
def test_live_rows_tile_the_bytes_however_they_come(chunks):
    parts = list(live(Capture.of(LINE, chunks)))
    rows = rows_of(parts)
    assert b"".join(part.batch.data.tobytes() for part in parts) == b"".join(chunk.data for chunk in chunks)
    ends = rows.start + rows.length
    assert rows.start.tolist() == [0, *ends[:-1].tolist()][: len(rows)]


def test_a_frame_on_a_quiet_line_does_not_wait_for_the_next_one():
    feed, (first, chunk) = Watched(LINE), spaced(POLL[:1] * 2, 200_000_000)
    feed.feed(Block.from_chunks([first]))
    assert not len(feed.tick(first.t_ns + 40_000_000).batch)  # a second tap may still be heard, and come before
    assert len(feed.tick(first.t_ns + 70_000_000).batch) == 1
    assert not len(feed.feed(Block.from_chunks([chunk])).batch)
    assert len(feed.tick(chunk.t_ns + 8_000_000).batch) == 1


def test_frames_before_the_newest_read_are_given_with_it():
    feed, heard, given = Watched(LINE), 0, 0
    chunks = spaced(POLL * 40)
    for chunk in chunks:
        batch = feed.feed(Block.from_chunks([chunk]), chunk.t_ns).batch  # as a tap does that is read after a pause
        if chunk.t_ns > chunks[0].t_ns + 60_000_000:
            assert given + len(batch) >= heard  # all before this one: nobody waits for the read behind it
        heard, given = heard + 1, given + len(batch)


def test_a_line_in_ascii_mode_is_seen_from_its_first_frames():
    data = [b":1103006B00037E\r\n", b":110306AE41565243401B\r\n"]
    data[1] = b":110306AE4156524340" + b"%02X" % (-sum(bytes.fromhex("110306AE4156524340")) & 0xFF) + b"\r\n"
    feed = Watched(LINE)
    parts = [feed.feed(Block.from_chunks([chunk])) for chunk in spaced(data * 3)]
    rows = rows_of([*parts, feed.close()])
    assert rows.protocol.tolist() == [1] * 6
    assert rows.check.all()


def test_frames_are_numbered_and_placed_on_after_bytes_were_missed():
    feed = Watched(LINE)
    chunks = spaced(POLL * 4)
    first = [feed.feed(Block.from_chunks(chunks[:4])), feed.restart(LINE, {0: 1000})]
    second = [feed.feed(Block.from_chunks(chunks[4:])), feed.close()]
    rows = rows_of([*first, *second])
    assert rows.index.tolist() == list(range(8))
    assert rows.start.tolist() == [0, 8, 19, 27, 1038, 1046, 1057, 1065]
    assert rows.request_start.tolist() == [-1, 0, -1, 19, -1, 1038, -1, 1057]
    assert rows.request.tolist() == [-1, 0, -1, 2, -1, 4, -1, 6]
    (batch, *_) = [part.batch for part in second if len(part.batch)]
    assert [frame.summary() for frame in batch.frames()][:2] == [
        "read 3 holding registers from 107 (40108)", "3 registers: 44609 22098 17216",
    ]  # fmt: skip


class Scripted:
    """A source that gives items when it is told to."""

    line = LINE
    waits = more = False

    def __init__(self, items):
        self._items = items
        self.go = threading.Event()

    def items(self):
        yield from self._items
        self.go.set()

    def judge(self, heard, sense, line):
        pass

    def close(self):
        pass


class Kept:
    """A recorder in memory."""

    def __init__(self):
        self.data = b""
        self.notes, self.lines, self.closed = [], [], False

    def write(self, block):
        self.data += block.data.tobytes()

    def note(self, note):
        self.notes.append(note.kind)

    def settings(self, line):
        self.lines.append(line)

    def tick(self):
        pass

    def close(self, heard_ns=None):
        self.closed, self.heard_ns = True, heard_ns


def test_bytes_that_the_analysis_cannot_take_are_recorded_and_counted():
    blocks = [Block.from_chunks([chunk]) for chunk in spaced(POLL * 200)]
    source, recorder = Scripted(blocks), Kept()
    with Session(source, recorder=recorder, backlog=500) as session:
        source.go.wait(10)  # all is recorded before the first step is taken
        steps = list(session.steps())
    sent = b"".join(POLL * 200)
    assert recorder.data == sent
    assert recorder.closed
    missed = sum(step.missed for step in steps)
    analysed = sum(int(step.batch.rows.length.sum()) for step in steps)
    assert missed + analysed == len(sent)
    assert 0 < analysed <= 500
    for step in steps:
        for row in range(len(step.batch)):
            start, length = int(step.batch.rows.start[row]), int(step.batch.rows.length[row])
            assert step.batch.bytes_of(row) == sent[start : start + length]


def test_a_replay_waits_for_the_analysis_and_misses_nothing():
    source = Scripted([Block.from_chunks([chunk]) for chunk in spaced(POLL * 200)])
    source.waits = True
    with Session(source, backlog=500) as session:
        steps = list(session.steps())
    assert sum(step.missed for step in steps) == 0
    assert sum(len(step.batch) for step in steps) == 400


class Clocks:
    """In place of the module `time`: each step takes so much of the processor, s, and none of the day."""

    def __init__(self, step_s):
        self._step_s, self._ran, self._now, self.slept = step_s, 0.0, 0.0, []

    def passes(self, step_s):
        self._step_s = step_s

    def thread_time(self):
        self._ran += self._step_s  # since it was last asked
        return self._ran

    def monotonic(self):
        return self._now

    def sleep(self, seconds):
        assert seconds > 0
        self.slept.append(seconds)
        self._now += seconds


@pytest.mark.parametrize(("step_s", "pause_s"), [(0.002, 0.018), (0.15, 0.1)])
def test_where_steps_are_dear_more_is_gathered_for_each(monkeypatch, step_s, pause_s):
    clocks = Clocks(step_s)
    monkeypatch.setattr(live_session, "time", clocks)
    pace = live_session._StepPace()
    for _ in range(60):
        pace.wait()
        pace.begin()
    assert clocks.slept[-1] == pytest.approx(pause_s, rel=0.01)
    assert sum(clocks.slept) == pytest.approx(clocks.monotonic())


def test_one_step_that_is_dear_holds_up_none_behind_it(monkeypatch):
    clocks = Clocks(0.002)
    monkeypatch.setattr(live_session, "time", clocks)
    pace = live_session._StepPace()
    for number in range(60):
        clocks.passes(0.2 if number == 50 else 0.002)
        pace.wait()
        pace.begin()
    assert max(clocks.slept[50:]) < 0.021


@pytest.mark.parametrize("waits", [False, True])
def test_only_a_line_that_does_not_wait_is_gathered(monkeypatch, waits):
    clocks = Clocks(0.02)
    monkeypatch.setattr(live_session, "time", clocks)
    source = Scripted([Block.from_chunks([chunk]) for chunk in spaced(POLL * 20)])
    source.waits = waits
    with Session(source) as session:
        steps = list(session.steps())
    assert sum(len(step.batch) for step in steps) == 40
    assert bool(clocks.slept) is not waits


@pytest.mark.parametrize("unplugged", [False, True])
def test_no_unit_is_blamed_for_an_answer_that_came_while_the_adapter_was_away(unplugged):
    before, after = spaced([*POLL * 4, POLL[0]]), spaced(POLL * 12)
    lost, back = before[-1].t_ns + 50_000_000, before[-1].t_ns + 700_000_000
    away = [PortEvent(lost, 0, "lost", "/dev/x: lost", {}), PortEvent(back, 0, "opened", "/dev/x: is back", {})]
    shift = back + 100_000_000 - after[0].t_ns
    later = [Block.from_chunks([Chunk(chunk.t_ns + shift, chunk.data)]) for chunk in after]
    items = [*(Block.from_chunks([chunk]) for chunk in before), *(away if unplugged else []), *later]
    with Session(Scripted(items)) as session:
        found = Findings.joined([step.findings for step in session.steps()])
    assert ("no-response" in {finding.code for finding in described(found)}) is not unplugged


def test_what_the_source_raises_comes_out_where_the_steps_are_taken():
    class Broken(Scripted):
        def items(self):
            yield Tick(1)
            raise captures.CaptureError("the adapter is on fire")

    recorder = Kept()
    with Session(Broken([]), recorder=recorder) as session, pytest.raises(captures.CaptureError, match="on fire"):
        list(session.steps())
    assert recorder.closed


def test_bytes_are_judged_with_the_line_that_they_were_heard_on():
    """Settings found twice while the analysis was behind: the first ones were judged by bytes that the others gave."""
    lines = [LineSettings(baud=baud, char_bits=10) for baud in (9600, 19200, 38400)]
    blocks = [Block.from_chunks([chunk]) for chunk in spaced(POLL * 2)][: len(lines)]

    judged = []

    class Settling(Scripted):
        def items(self):
            for line, block in zip(lines, blocks, strict=True):
                self.line = line
                yield PortEvent(int(block.t_ns[0]), 0, "settled", str(line.baud), {})
                yield block
            self.go.set()

        def judge(self, heard, _, line):
            if heard:
                judged.append((heard, line))

    source = Settling([])
    with Session(source) as session:
        source.go.wait(10)
        list(session.steps())
    assert judged == [(len(block.data), line) for block, line in zip(blocks, lines, strict=True)]


def test_other_settings_of_the_line_reach_the_record_and_the_analysis():
    source = Scripted([PortEvent(1, 0, "settled", "9600", {}), *[Block.from_chunks([c]) for c in spaced(POLL)]])
    source.line = LineSettings(baud=9600, char_bits=10)
    recorder = Kept()
    with Session(source, recorder=recorder) as session:
        rows = Rows.joined([step.batch.rows for step in session.steps()])
    assert recorder.lines == [source.line]
    assert recorder.notes == ["settled"]
    assert rows.kind.tolist() == [Kind.REQUEST, Kind.RESPONSE]


@pytest.mark.parametrize("sample", ["healthy.jsonl", "troubled.jsonl", "mbpoll.mcap"])
def test_what_is_settled_is_what_was_told_on_the_way(sample):
    capture = captures.open(samples.path(sample))
    watched, told = Watched(capture.line), []
    for chunk in capture.chunks():
        told.append(watched.feed(Block.from_chunks([chunk])))
        pending = watched.analyzer.pending()
        counted = sum(len(part.batch) for part in watched.settled) + len(pending)
        assert counted == sum(len(part.batch) for part in told), "every row is settled or pending"
    told.append(watched.close())
    for name in COLUMNS:
        assert rows_of(watched.settled).column(name).tolist() == rows_of(told).column(name).tolist(), name
    whole = list(analyse(captures.open(samples.path(sample))))
    for name in ("findings", "transactions"):
        assert said_by(watched.settled, name) == said_by(told, name) == said_by(whole, name)


def said_by(parts, name):
    """The rows of one table of results, whatever their order; NaN is like NaN."""
    return sorted(repr(row) for part in parts for row in getattr(part, name).tolist())


def test_findings_settle_with_the_rows_that_they_stand_on():
    for sample in ("troubled.jsonl", "mbpoll.mcap"):
        placed_in_all = 0
        for part in analyse(captures.open(samples.path(sample))):
            assert isinstance(part, Analysed)
            placed = part.findings[part.findings.start >= 0]
            assert len(placed) == int((part.batch.finding_rows >= 0).sum())
            placed_in_all += len(placed)
        assert placed_in_all
