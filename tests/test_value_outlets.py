"""No way out tells a value under a register that it was not read from, nor one of an answer that may be another's.

Unit 9 queues: behind a silence each answer comes behind the next request, and each poll's values are its own. Of unit
10 all polls hold the same, so nobody can tell whose its displaced answers are; they alone hold 4321.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest
import rtuscope
from lakes import BEGIN_NS, batch
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from queuing import LINE, POLLS, Talk, adu
from ways_out import model_values

import captures
from analyzer.agents.bus import CaptureFacts
from analyzer.analysis import Analysis
from analyzer.core import analyse
from analyzer.exports import ExportOptions, export
from analyzer.fleet.lake import Lake
from analyzer.live import Replay, Session
from analyzer.live.lines import LiveJsonLines, Recent, ShownRow, TextLines
from analyzer.live.outlets import Mailbox
from analyzer.live.outlets.gauges import ValueGauges
from analyzer.live.streams import InfluxLines
from analyzer.registers.watch import ValueWatch
from analyzer.reports.description.model import describe
from analyzer.twin.record import twins
from captures import Capture, Chunk
from dissectors.maps import read_map

UNSURE = 4321
LEVELS = {9: lambda poll: range(7000 * poll, 7000 * poll + 40), 10: lambda _: range(1)}  # first word of each poll
SECOND = {9: lambda poll: 30000 + 900 * poll, 10: lambda _: 0}
Told = tuple[int, int, float]  # unit, address, value


class TwoUnits(Talk):
    """Unit 10's polls, all alike; `word` is what they hold."""

    word = 0

    def ask(self, poll: int, pause_ms: float = 20) -> tuple[int, int]:
        return poll, self.send(adu(bytes((10,)) + POLLS[poll][1:]), pause_ms)

    def answer(self, asked: tuple[int, int], pause_ms: float = 15) -> int:
        self.truth[self.offset] = asked[1]
        return self.send(adu(bytes((10, 3, 4)) + self.word.to_bytes(2) * 2), pause_ms)


def displaced_bus() -> Capture:
    talk = TwoUnits()
    talk.rounds(4)
    talk.word = UNSURE
    talk.shifted(12, ends=False)
    other = Talk()
    other.now, other.offset = talk.now + 900 * 1_000_000, talk.offset
    other.rounds(8)
    other.shifted(30)
    other.rounds(4)
    return Capture.of(LINE, [Chunk(BEGIN_NS + c.t_ns, c.data) for c in (*talk.chunks, *other.chunks)])


CAPTURE = displaced_bus()
MAP = "area,address,name,type\n" + "".join(
    f"holding,{16 * poll + word},at {16 * poll + word},u16\n" for poll in range(4) for word in range(2)
)


def charts(folder: Path) -> Any:
    (folder / "polls.csv").write_text(MAP, encoding="utf-8")
    return dict.fromkeys((9, 10), read_map(folder / "polls.csv"))


def written(folder: Path) -> Path:
    path = folder / "bus.jsonl"
    captures.write(path, CAPTURE)
    return path


def exported(folder: Path, name: str, table: str = "frames") -> Path:
    out = folder / name
    export(CAPTURE, out, options=ExportOptions(table=table))
    return out


def from_frames(lines: list[dict[str, Any]]) -> Iterator[Told]:
    """A frame's address and values, as every format has them; what is unsure must have no address."""
    for line in lines:
        if line["direction"] == "response":
            assert not (line["unsure"] and line["address"] is not None), line
            if line["address"] is not None:
                for n, value in enumerate(line["values"]):
                    yield line["unit"], line["address"] + n, value


def json_frames(folder: Path) -> Iterator[Told]:
    yield from from_frames([orjson.loads(line) for line in exported(folder, "f.jsonl").open("rb")])


def fields_of_frames(folder: Path) -> Iterator[Told]:
    for line in map(orjson.loads, exported(folder, "f.jsonl").open("rb")):
        stack = list(line["fields"]) if line["direction"] == "response" else []
        while stack:
            field = stack.pop()
            stack += field.get("fields") or ()
            if field.get("address") is not None and isinstance(field.get("value"), int):
                yield line["unit"], field["address"], field["value"]


def csv_frames(folder: Path) -> Iterator[Told]:
    rows = csv.DictReader(io.StringIO(exported(folder, "f.csv").read_text(encoding="utf-8-sig")))
    lines: list[dict[str, Any]] = []
    for row in rows:
        numbers = [int(word) for word in row["values"].split()]
        about = {"direction": row["direction"], "unit": int(row["unit"]), "unsure": row["unsure"] == "true"}
        lines.append({**about, "address": int(row["address"]) if row["address"] else None, "values": numbers})
    yield from from_frames(lines)


def parquet_frames(folder: Path) -> Iterator[Told]:
    pq = pytest.importorskip("pyarrow.parquet")
    columns = ["direction", "unit", "address", "values", "unsure"]
    yield from from_frames(pq.read_table(exported(folder, "f.parquet"), columns=columns).to_pylist())


def from_records(records: list[dict[str, Any]]) -> Iterator[Told]:
    for record in records:
        yield int(record["unit"]), int(record["address"]), float(record["raw"])


def value_records(_folder: Path) -> Iterator[Told]:
    yield from from_records(list(Analysis(CAPTURE).records("values")))


def value_csv(folder: Path) -> Iterator[Told]:
    text = exported(folder, "v.csv", "values").read_text(encoding="utf-8-sig")
    yield from from_records(list(csv.DictReader(io.StringIO(text))))


def value_json(folder: Path) -> Iterator[Told]:
    yield from from_records([orjson.loads(line) for line in exported(folder, "v.jsonl", "values").open("rb")])


def value_parquet(folder: Path) -> Iterator[Told]:
    pq = pytest.importorskip("pyarrow.parquet")
    yield from from_records(pq.read_table(exported(folder, "v.parquet", "values")).to_pylist())


def mapped_records(folder: Path) -> Iterator[Told]:
    charts(folder)
    yield from from_records(list(Analysis(CAPTURE).with_maps(str(folder / "polls.csv")).records("values")))


def mcap_topics(folder: Path) -> Iterator[Told]:
    with exported(folder, "m.mcap").open("rb") as file:
        for _, channel, _, message in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            parts = channel.topic.split("/")
            if parts[1] == "unit":
                for field, value in message.ListFields():
                    if field.name.startswith("r") and field.name[1:].isdigit():
                        yield int(parts[2]), int(field.name[1:]), value


def inferred(folder: Path) -> Iterator[Told]:
    for value in rtuscope.registers(written(folder)):
        if value.words == 1:
            for number in (value.minimum, value.maximum, value.last):
                if isinstance(number, int):
                    yield value.unit, value.address, number


def interface_registers(_folder: Path) -> Iterator[Told]:
    for (unit, _, address), (value, before) in model_values(CAPTURE).items():
        yield from ((unit, address, number) for number in (value, before) if number is not None)


def watched(folder: Path) -> Iterator[Told]:
    watch = ValueWatch(charts(folder))
    for part in analyse(CAPTURE):
        watch.feed(part.batch)
    for value in watch.values():
        for number in (value.minimum, value.maximum, float(value.last)):
            assert number is not None
            yield value.unit, value.address, number


def live_rows() -> Iterator[ShownRow]:
    with Session(Replay(CAPTURE, None)) as session:
        recent = Recent()
        for step in session.steps():
            yield from (shown for shown in recent.feed(step) if not shown.late)


def influx(folder: Path) -> Iterator[Told]:
    lines = InfluxLines(charts=charts(folder))
    for shown in live_rows():
        for line in lines.of(shown).splitlines():
            if line.startswith("modbus_value"):
                tags = dict(part.split("=", 1) for part in line.replace("\\ ", "_").split(" ")[0].split(",")[1:])
                yield (
                    int(tags["unit"]),
                    int(tags["name"].removeprefix("at_")),
                    float(line.split("value=")[1].split()[0]),
                )


def sniffed_text(folder: Path) -> Iterator[Told]:
    lines = TextLines(colour=False, width=None, charts=charts(folder))
    for shown in live_rows():
        text, frame = lines.of(shown), shown.frame()
        for part in text.split("at ")[1:]:
            yield frame.unit, int(part.split()[0]), float(part.split()[1].strip(","))


def sniffed_json(folder: Path) -> Iterator[Told]:
    lines = LiveJsonLines(charts=charts(folder))
    for shown in live_rows():
        line = json.loads(lines.of(shown).splitlines()[0])
        yield from from_frames([line])
        for reading in line.get("mapped", ()) if line["direction"] == "response" else ():
            yield line["unit"], reading["address"], reading["value"]


def gauges(folder: Path) -> Iterator[Told]:
    pytest.importorskip("prometheus_client")
    served = ValueGauges(charts(folder))
    with Session(Replay(CAPTURE, None)) as session:
        for step in session.steps():
            served.feed(step.batch)
            for family in served.collect():
                for sample in family.samples:
                    yield int(sample.labels["unit"]), int(sample.labels["address"]), sample.value


def mqtt(folder: Path) -> Iterator[Told]:
    pytest.importorskip("paho.mqtt")
    from analyzer.live.outlets.mqtt import Mqtt

    letters: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Mailbox, "put", lambda _, letter: letters.append(letter))
        outlet = Mqtt("mqtt://127.0.0.1:1/bus", charts(folder), tell=lambda _: None)
        with Session(Replay(CAPTURE, None), outlets=[outlet]) as session:
            for _ in session.steps():
                pass
    for letter in letters:
        parts = letter.topic.split("/")
        if parts[1:2] == ["unit"] and parts[3:4] == ["values"] and letter.payload:
            yield int(parts[2]), int(parts[4].removeprefix("at_")), float(letter.payload)


def lake(folder: Path) -> Iterator[Told]:
    pytest.importorskip("duckdb")
    batch(folder / "lake", written(folder))
    yield from from_records(Lake(str(folder / "lake")).arrow("SELECT * FROM values").to_pylist())


def twin_registers(_folder: Path) -> Iterator[Told]:
    for unit, twin in twins(CAPTURE).items():
        for poll, request in enumerate(POLLS):
            for _ in range(80):
                if (answer := twin.answer(request[1:])) is not None:
                    for word in range(2):
                        data = answer.pdu[2 + 2 * word : 4 + 2 * word]
                        yield unit, 16 * poll + word, int.from_bytes(data)


def described(_folder: Path) -> Iterator[Told]:
    for unit in describe(CAPTURE).units:
        for register in unit.registers:
            for number in (register.value.minimum, register.value.maximum, register.value.last):
                if register.value.words == 1 and isinstance(number, int):
                    yield unit.unit, register.value.address, number


def agents(folder: Path) -> Iterator[Told]:
    facts = CaptureFacts(written(folder))
    for unit in (9, 10):
        for poll in range(4):
            for _, _, held in facts.values(unit, "holding", 16 * poll, 2):
                yield from ((unit, 16 * poll + n, word) for n, word in enumerate(held))


def plotted(_folder: Path) -> Iterator[Told]:
    pytest.importorskip("matplotlib")
    for unit in (9, 10):
        for address in (0, 16, 32, 48):
            drawn: Any = Analysis(CAPTURE).plot.register(unit, address).lines[0].get_ydata()
            yield from ((unit, address, value) for value in drawn.tolist())


OUTLETS: dict[str, Callable[[Path], Iterator[Told]]] = {
    each.__name__: each
    for each in (
        json_frames, fields_of_frames, csv_frames, parquet_frames, value_records, value_csv, value_json, value_parquet,
        mapped_records, mcap_topics, inferred, interface_registers, watched, influx, sniffed_text, sniffed_json, gauges,
        mqtt, lake, twin_registers, described, agents, plotted,
    )
}  # fmt: skip


def test_the_bus_has_answers_that_are_displaced_and_such_that_are_unsure() -> None:
    rows = [row for part in analyse(CAPTURE) for row in part.batch.rows]
    assert sum(row.taken_for_start >= 0 and not row.unsure for row in rows if row.unit == 9) == 30
    assert sum(row.unsure for row in rows) == sum(row.unsure for row in rows if row.unit == 10) == 12


@pytest.mark.parametrize("outlet", OUTLETS)
def test_every_value_stands_under_its_own_register(outlet: str, tmp_path: Path) -> None:
    told = set(OUTLETS[outlet](tmp_path))
    assert {unit for unit, _, _ in told} == {9, 10}
    for unit, address, value in told:
        poll, word = divmod(address, 16)
        assert value != UNSURE, f"unit {unit} register {address}"
        assert value in LEVELS[unit](poll) if word == 0 else value == SECOND[unit](poll), (unit, address, value)
