"""MCAP: the capture bit for bit, and what any viewer needs to show the rest."""

import json
from collections import defaultdict

import pytest
from buses import LINE, adu, spaced, streams
from hypothesis import HealthCheck, given, settings
from mcap.reader import make_reader
from running import ran, spawned

import captures
from analyzer.exports import export
from analyzer.exports.schemas import LOG
from captures import Capture

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


def messages(path):
    """Messages by topic: (log_time, content)."""
    found = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            assert schema is not None
            assert schema.encoding == "jsonschema"
            assert channel.message_encoding == "json"
            content = json.loads(message.data)
            conforms(content, json.loads(schema.data))
            found[channel.topic].append((message.log_time, content))
    return found


def conforms(content, schema):
    """Types and required keys of a flat schema, which is all that ours are."""
    types = {"integer": int, "number": (int, float), "string": str, "boolean": bool, "array": list, "object": dict}
    for key, value in content.items():
        rule = schema.get("properties", {}).get(key, {})
        options = rule.get("oneOf", [rule])
        kinds = [option["type"] for option in options if "type" in option]
        assert not kinds or any(
            value is None if kind == "null" else isinstance(value, types[kind]) for kind in kinds
        ), key


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


def test_frames_with_their_times(capsys, exported):
    frames = messages(exported)["/frames"]
    lines = [json.loads(line) for line in ran(capsys, "export", exported).out.splitlines()]
    assert [{key: value for key, value in frame.items() if key != "summary"} for _, frame in frames] == lines
    assert [time for time, _ in frames] == [line["t_end_ns"] for line in lines]
    assert frames[0][1]["summary"] == "read 3 holding registers from 107 (40108)"


def test_transactions(exported):
    found = [content for _, content in messages(exported)["/transactions"]]
    assert [content["status"] for content in found] == ["answered"] * 4 + ["exception", "unanswered"]
    assert found[0]["response_time_ms"] == pytest.approx(6, rel=0.01)
    assert found[-1]["response"] is None


def test_register_values_by_address(exported):
    found = messages(exported)
    assert [content for _, content in found["/unit/17/holding"]] == [
        {"r107": 44609, "r108": 22098, "r109": 17216},
        {"r1": 10, "r2": 258},
    ]
    first, second = (content for _, content in found["/unit/17/coils"])
    assert list(first) == [f"b{address}" for address in range(19, 56)]
    assert (first["b19"], first["b20"], first["b55"]) == (1, 0, 1)
    assert second == {"b172": 1}
    assert "/unit/17/input" not in found


def test_schemas_channels_and_metadata(exported):
    with exported.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    schemas = {schema.id: schema for schema in summary.schemas.values()}
    topics = {channel.topic: schemas[channel.schema_id] for channel in summary.channels.values()}
    assert topics["/findings"].name == "foxglove.Log"
    assert json.loads(topics["/findings"].data) == LOG
    assert {"/frames", "/transactions", "/rtuscope/chunks"} <= set(topics)
    assert all(index.compression == "zstd" for index in summary.chunk_indexes)
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


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(fed=streams())
def test_any_capture_survives(tmp_path, fed):
    out = tmp_path / "any.mcap"
    capture = Capture.of(LINE, fed)
    export(capture, out)
    assert chunks(out) == list(capture.chunks())
