"""MCAP: the capture bit for bit, and what any viewer needs to show the rest."""

import json
from collections import defaultdict
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from buses import LINE, adu, spaced, streams, transactions
from carried import values_of
from google.protobuf.json_format import MessageToDict
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from mcap.decoder import DecoderFactory as AnyDecoders
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from running import ran, spawned

import analyzer
import captures
from analyzer.exports import ExportOptions, export
from analyzer.exports.targets.mcap import schemas
from analyzer.exports.targets.mcap.schemas import function_names
from captures import Capture, samples
from dissectors import Function
from dissectors.functions import functions
from dissectors.maps.model import MappedValue, RegisterMap

FRAMES = [
    adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad"),
    adu("110100130025"), bytes.fromhex("110105cd6bb20e1b45e6"),
    adu("110500acff00"), adu("110500acff00"),
    adu("111000010002" + "04000a0102"), adu("111000010002"),
    adu("110400080001"), adu("118402"),
    adu("1102000000 01".replace(" ", "")),
]  # fmt: skip


@pytest.fixture
def exported(capsys, tmp_path):
    bus, out = tmp_path / "bus.jsonl", tmp_path / "bus.mcap"
    captures.write(bus, spaced(FRAMES), line=LINE)
    assert ran(capsys, "export", bus, "-o", out).status == 0
    return out


class Texts(AnyDecoders):
    """Messages in JSON, for the library's reader."""

    def decoder_for(self, message_encoding: str, schema: Schema | None) -> Callable[[bytes], Any] | None:
        return json.loads if message_encoding == "json" and schema and schema.encoding == "jsonschema" else None


def messages(path):
    """Messages by topic, in the file's order: (log_time, content). Protobuf's own library reads them."""
    found = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory(), Texts()])
        for _, channel, message, content in reader.iter_decoded_messages(log_time_order=False):
            found[channel.topic].append((message.log_time, content))
    return found


def plain(message):
    """A message as a mapping of what it has, 0 included, enums by name."""
    return MessageToDict(
        message,
        preserving_proto_field_name=True,
        always_print_fields_with_no_presence=True,
        unquote_int64_if_possible=True,
    )


def chunks(path):
    return list(captures.open(path).chunks())


def test_it_reads_back_as_the_same_capture(exported):
    bus = exported.with_suffix(".jsonl")
    assert chunks(exported) == chunks(bus)
    assert captures.open(exported).line == captures.open(bus).line


def test_every_command_takes_it(capsys, exported):
    bus = exported.with_suffix(".jsonl")
    assert ran(capsys, "export", exported).out == ran(capsys, "export", bus).out
    same, page = (json.loads(ran(capsys, "report", path, "--json").out) for path in (exported, bus))
    assert {**same, "source": "", "format": ""} == {**page, "source": "", "format": ""}


def same_frames(path, lines):
    """Whether the frames in a file say what the JSON lines do."""
    found = messages(path)["/frames"]
    assert len(found) == len(lines)
    for (time, message), line in zip(found, lines, strict=True):
        assert time == max(line["t_end_ns"], 0)
        for key in ("index", "start", "length", "t_start_ns", "unit", "function", "crc_ok"):
            assert getattr(message, key) == line[key], key
        content = plain(message)
        assert (content["protocol"], content["direction"]) == (line["protocol"], line["direction"])
        assert message.data.hex() == line["hex"]
        assert message.confidence == pytest.approx(line["confidence"], abs=1e-6)
        assert message.port == line.get("port", 0)
        assert message.unsure == line["unsure"]
        for key in (
            "exception",
            "request_start",
            "taken_for_start",
            "response_time_ns",
            "response_time_low_ns",
            "response_time_high_ns",
        ):
            assert (getattr(message, key) if message.HasField(key) else None) == line.get(key), key


def test_frames_with_their_times(capsys, exported):
    lines = [json.loads(line) for line in ran(capsys, "export", exported).out.splitlines()]
    same_frames(exported, lines)
    first = plain(messages(exported)["/frames"][0][1])
    assert (first["function"], first["address"], first["quantity"]) == ("READ_HOLDING_REGISTERS", 107, 3)


def test_transactions(exported):
    found = [content for _, content in messages(exported)["/transactions"]]
    assert [plain(content)["status"] for content in found] == ["answered"] * 4 + ["exception", "unheard"]
    assert found[0].response_time_ms == pytest.approx(6, rel=0.01)
    assert [content.HasField("response") for content in found] == [True] * 5 + [False]
    assert [content.HasField("response_time_ms") for content in found] == [True] * 5 + [False]


def test_transactions_take_as_long_as_the_table_says(capsys, tmp_path):
    """Exact, an interval or unknown: the message says what a row of `--table transactions` does."""
    path = tmp_path / "bus.mcap"
    bus = samples.path("troubled.jsonl")
    ran(capsys, "export", bus, "-o", path)
    rows = {row["request"]: row for row in analyzer.open(bus).records("transactions")}
    found = [content for _, content in messages(path)["/transactions"]]
    assert len(found) == len(rows)
    kinds = set()
    for content in found:
        row = rows[content.request]
        for name in ("response_time", "response_time_low", "response_time_high"):
            told = row[f"{name}_ns"]
            assert content.HasField(f"{name}_ms") == (told is not None)
            assert told is None or getattr(content, f"{name}_ms") == told / 1e6
        kinds.add((row["response_time_ns"] is None, row["response_time_low_ns"] is None))
    assert kinds == {(False, False), (True, False), (True, True)}


def test_register_values_by_address(exported):
    units = {topic: found for topic, found in messages(exported).items() if topic.startswith("/unit/")}
    found = {topic: [plain(content) for _, content in contents] for topic, contents in units.items()}
    read, written = {"r107": 44609, "r108": 22098, "r109": 17216}, {"r1": 10, "r2": 258}
    assert [content for content in found["/unit/17/holding"] if content in (read, written)] == [read, written]
    first = next(content for content in found["/unit/17/coils"] if "b19" in content)
    assert set(first) == {f"b{address}" for address in range(19, 56)}
    assert (first["b19"], first["b20"], first["b55"]) == (True, False, True)
    assert {"b172": True} in found["/unit/17/coils"]
    assert not any("input" in topic for topic in found)


def told(path):
    """Values by (log_time, unit, area): all numbers by address, whichever topics they are on."""
    found = defaultdict[tuple[int, int, str], dict[str, int]](dict)
    for topic, contents in messages(path).items():
        if topic.startswith("/unit/"):
            _, _, unit, area = topic.split("/")
            for time, content in contents:
                found[time, int(unit), area].update({field.name: int(value) for field, value in content.ListFields()})
    return found


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(pairs=st.lists(transactions(), min_size=1, max_size=12))
def test_values_are_those_that_annotation_tells(tmp_path, pairs):
    """One by one from the annotated fields, and by columns: the same numbers at the same addresses."""
    # Function 23 that reads where it writes tells two values of one register: what it wrote, then what it read.
    assume(not any(pair[0][1] == 0x17 and pair[0][2:6] < b"\0\2" for pair in pairs))
    out = tmp_path / "any.mcap"
    capture = Capture.of(LINE, spaced([frame for pair in pairs for frame in pair]))
    export(capture, out)
    expected = {}
    for frame in analyzer.Analysis(capture).frames():
        read = values_of(frame, frame.fields())
        if read is not None:
            expected[frame.t_end_ns, frame.unit, read.area] = dict(read.numbers)
    assert told(out) == expected


def test_values_of_a_request_in_the_batch_before(tmp_path, monkeypatch):
    """However a capture is cut into batches, an answer confirms what its request wrote."""
    monkeypatch.setattr("analyzer.core._BLOCK", 64)
    write = [adu("111000010002" + "04000a0102"), adu("111000010002")]
    out = tmp_path / "cut.mcap"
    export(Capture.of(LINE, spaced(write * 100)), out)
    found = messages(out)["/unit/17/holding"]
    assert len(found) == 100
    assert all((content.r1, content.r2) == (10, 258) for _, content in found)


def test_too_many_addresses_are_left_out_and_told(tmp_path, monkeypatch):
    monkeypatch.setattr(schemas, "MAX_FIELDS", 3)
    pieces = [piece for n in range(5) for piece in (adu(f"11060{n}000007"), adu(f"11060{n}000007"))]
    out = tmp_path / "many.mcap"
    export(Capture.of(LINE, spaced(pieces)), out)
    assert len(messages(out)["/unit/17/holding"]) == 3
    with out.open("rb") as file:
        metadata = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert metadata["rtuscope/left out"] == {"values": "2 messages: too many addresses"}


def test_a_topic_goes_on_with_addresses_that_come_later(tmp_path, monkeypatch):
    monkeypatch.setattr("analyzer.core._BLOCK", 64)
    pieces = [piece for n in range(40) for piece in (adu(f"1106{n // 8:02x}000007"), adu(f"1106{n // 8:02x}000007"))]
    out = tmp_path / "later.mcap"
    export(Capture.of(LINE, spaced(pieces)), out)
    found = [plain(content) for _, content in messages(out)["/unit/17/holding"]]
    assert found == [{f"r{256 * (n // 8)}": 7} for n in range(40)]


def test_mapped_values_by_name(tmp_path):
    chart = RegisterMap("x", (MappedValue("holding", 107, "Active power", "s32", length=2, scale=0.1, unit="kW"),))
    out = tmp_path / "mapped.mcap"
    export(Capture.of(LINE, spaced(FRAMES)), out, options=ExportOptions(charts={17: chart}))
    ((_, content),) = messages(out)["/unit/17/values/Active_power"]
    assert content.DESCRIPTOR.full_name == "rtuscope.Value_kW"
    assert content.value == pytest.approx(0.1 * ((44609 << 16 | 22098) - (1 << 32)))


def test_findings_as_a_log(tmp_path):
    model = pytest.importorskip("analyzer.tables.findings")
    from analyzer.tables.findings import codes

    out = tmp_path / "found.mcap"
    export(Capture.of(LINE, spaced(FRAMES)), out)
    found = messages(out)
    frames = [message for _, message in found["/frames"]]
    on_frames = [frame for frame in frames if frame.findings]
    assert found["/findings"]
    assert sum(frame.findings for frame in frames) <= len(found["/findings"])
    ends = {time for time, _ in found["/frames"]}
    for time, log in found["/findings"]:
        assert time in ends
        assert log.timestamp.seconds * 10**9 + log.timestamp.nanos == time
        assert log.name in codes()
        assert log.level in (2, 3, 4)
        assert log.message
    assert any(frame.HasField("exception") for frame in on_frames)
    assert model.Severity.WARNING


def test_several_taps_exceptions_noise_and_evidence(capsys, tmp_path):
    chunks = spaced([*FRAMES, b"\xff\x00\x13", *FRAMES])
    second = [captures.Chunk(chunk.t_ns + 2_000_000_000, chunk.data, port=1) for chunk in spaced(FRAMES)]
    bus, out = tmp_path / "bus.jsonl", tmp_path / "bus.mcap"
    captures.write(bus, chunks + second, line=LINE)
    export(captures.open(bus), out, options=ExportOptions(explain=True, noise=True))
    lines = [json.loads(line) for line in ran(capsys, "export", bus, "--explain", "--noise").out.splitlines()]
    frames = [line for line in lines if "kind" not in line]
    same_frames(out, frames)
    found = messages(out)
    for (_, message), line in zip(found["/frames"], frames, strict=True):
        why, runner_up = line["explain"], line["explain"]["runner_up"]
        for name in ("length", "crc", "silence", "conversation", "margin"):
            assert getattr(message, f"evidence_{name}") == pytest.approx(why[name], abs=0.006)
        assert plain(message)["runner_up_kind"] == runner_up["kind"]
        assert (message.runner_up_start if message.HasField("runner_up_start") else None) == runner_up["start"]
    noise = [line for line in lines if line.get("kind") == "noise"]
    assert [(time, m.start, m.length, m.t_start_ns, m.port, m.data.hex()) for time, m in found["/noise"]] == [
        (n["t_end_ns"], n["start"], n["length"], n["t_start_ns"], n.get("port", 0), n["hex"]) for n in noise
    ]


def test_ascii_frames_as_the_bytes_that_they_stand_for(capsys, tmp_path):
    bus, out = tmp_path / "bus.jsonl", tmp_path / "bus.mcap"
    pieces = [b":1103006B00037E\r\n", b":110306AE41565243403F\r\n"] * 3
    captures.write(bus, spaced(pieces), line=LINE)
    export(captures.open(bus), out)
    same_frames(out, [json.loads(line) for line in ran(capsys, "export", bus).out.splitlines()])


def test_every_function_has_a_name_that_an_enum_can_have(monkeypatch):
    one = functions()[3]
    odd = {
        65: Function(65, "Чтение", one.request, one.response),
        66: Function(66, "3 phases (L1/L2/L3)", one.request, one.response),
        67: Function(67, one.name, one.request, one.response),
    }
    monkeypatch.setattr("analyzer.exports.targets.mcap.schemas.functions", lambda: {**functions(), **odd})
    names = function_names()
    assert sorted(names.values()) == [0, *sorted({**functions(), **odd})]
    assert all(name.isascii() and name.isidentifier() for name in names)
    assert (names["FUNCTION_65"], names["FUNCTION_66"], names["READ_HOLDING_REGISTERS_67"]) == (65, 66, 67)


def test_schemas_channels_and_metadata(exported):
    with exported.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    schemas = {schema.id: schema for schema in summary.schemas.values()}
    topics = {channel.topic: schemas[channel.schema_id] for channel in summary.channels.values()}
    assert topics["/findings"].name == "foxglove.Log"
    assert {"/frames", "/transactions", "/rtuscope/chunks"} <= set(topics)
    assert topics["/frames"].encoding == "protobuf"
    assert summary.statistics.message_count == sum(len(found) for found in messages(exported).values())
    about = metadata["rtuscope"]
    assert about["tool"].startswith("rtuscope ")
    assert (about["baud"], about["timed"], about["source_format"]) == ("19200", "true", "serial-chunks")


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    folder = tmp_path_factory.mktemp("long")
    bus, out = folder / "bus.jsonl", folder / "bus.mcap"
    captures.write(bus, spaced(FRAMES * 300), line=LINE)
    export(captures.open(bus), out)
    return out


def test_messages_stand_in_time_order_and_every_reader_finds_them(long):
    """By the index in time order, a topic alone, a stretch of time, and in sequence without index: all agree."""
    with long.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        indexed = [(c.topic, m.log_time, bytes(m.data)) for _, c, m in reader.iter_messages()]
        one = [(c.topic, m.log_time, bytes(m.data)) for _, c, m in reader.iter_messages(topics=["/frames"])]
        middle = indexed[len(indexed) // 2][1]
        rest = list(reader.iter_messages(starting_at=middle))
    with long.open("rb") as file:
        stream = NonSeekingReader(file, validate_crcs=True)
        listed = [(c.topic, m.log_time, bytes(m.data)) for _, c, m in stream.iter_messages(log_time_order=False)]
    assert len(summary.chunk_indexes) > 2
    assert sorted(indexed) == sorted(listed)
    assert all(a[1] <= b[1] for a, b in pairwise(indexed))
    assert one == [message for message in indexed if message[0] == "/frames"]
    assert len(rest) == sum(message[1] >= middle for message in indexed)
    analysed = [message for message in listed if message[0] in ("/frames", "/transactions")]
    late = sum(a[1] > b[1] for a, b in pairwise(analysed))
    assert late < len(analysed) / 100
    counted = {
        summary.channels[number].topic: count for number, count in summary.statistics.channel_message_counts.items()
    }
    assert counted == {topic: sum(message[0] == topic for message in listed) for topic in counted}


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.99])
def test_a_file_that_was_cut_still_opens_and_says_so(capsys, tmp_path, long, share):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(long.read_bytes()[: int(share * long.stat().st_size)])
    done = ran(capsys, "report", cut)
    assert done.status in (0, 1)
    assert "damaged" in done.out
    kept = chunks(cut)
    assert kept == chunks(long)[: len(kept)]


def test_to_a_pipe(exported):
    bus = exported.with_suffix(".jsonl")
    done = spawned("export", bus, "-o", "-", "--format", "mcap")
    assert done.status == 0
    assert done.raw == exported.read_bytes()


def test_times_before_the_epoch_are_0_in_the_index_and_kept_in_the_chunks(tmp_path):
    out = tmp_path / "early.mcap"
    early = Capture.of(LINE, [captures.Chunk(-5_000_000_000, FRAMES[0]), captures.Chunk(-4_900_000_000, FRAMES[1])])
    export(early, out)
    assert [time for time, _ in messages(out)["/frames"]] == [0, 0]
    assert [chunk.t_ns for chunk in chunks(out)] == [-5_000_000_000, -4_900_000_000]


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(fed=streams())
def test_any_capture_survives(tmp_path, fed):
    out = tmp_path / "any.mcap"
    capture = Capture.of(LINE, fed)
    export(capture, out)
    assert chunks(out) == list(capture.chunks())
