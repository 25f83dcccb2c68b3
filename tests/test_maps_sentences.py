"""What sentences, titles and notation say of all values of a file, and files that are no maps."""

from __future__ import annotations

from pathlib import Path

import pytest
from oddmaps import check_import, row_texts

from dissectors.maps import MapError, vocabulary
from dissectors.maps.importers import import_maps

_FILES: dict[str, tuple[str, str | bytes, list[str]]] = {
    "a type that a sentence says of all": (
        "meter.txt",
        "Every parameter is a 32-bit float in two registers, read with function 4.\n\n"
        "Address   Parameter   Unit\n0         Voltage     V\n2         Current     A\n6         Power       W\n",
        ["input 0 f32 V r Voltage", "input 2 f32 A r Current", "input 6 f32 W r Power"],
    ),
    "no type for all where addresses lie too near": (
        "meter.txt",
        "All registers are 32-bit floats.\n\n"
        "Address   Parameter   Unit\n0         Voltage     V\n1         Current     A\n2         Power       W\n",
        ["holding 0 u16 V Voltage", "holding 1 u16 A Current", "holding 2 u16 W Power"],
    ),
    "codes that a sentence explains": (
        "gas.csv",
        "Types: A = unsigned 16 bit, B = signed 16 bit, C = 32 bit float\nAddr,Tag,T,Unit\n"
        "0,Oxygen,C,%\n2,Temperature,B,K\n3,Speed,A,Hz\n",
        ["holding 0 f32 % Oxygen", "holding 2 s16 K Temperature", "holding 3 u16 Hz Speed"],
    ),
    "the first register, which is sent as 0": (
        "list.md",
        "Första registret är adress 1 i listan och sänds som 0 på bussen.\n\n"
        "| Adress | Namn | Enhet |\n|---|---|---|\n| 1 | Tryck | bar |\n| 2 | Flöde | l |\n",
        ["holding 0 u16 bar Tryck", "holding 1 u16 l Flöde"],
    ),
    "offsets from the base in the title of their block": (
        "rack.md",
        "## System (base 0x1000)\n\n| Offset | Name | Unit |\n|---|---|---|\n| 0 | Voltage | V |\n"
        "| 1 | Current | A |\n\n"
        "## Module (base 0x2000)\n\n| Offset | Name | Unit |\n|---|---|---|\n| 0 | Highest cell | V |\n"
        "| 5 | Heat | K |\n",
        [
            "holding 4096 u16 V Voltage", "holding 4097 u16 A Current", "holding 8192 u16 V Highest cell",
            "holding 8197 u16 K Heat",
        ],
    ),
    "addresses within blocks, as records": (
        "rack.json",
        '{"groups": [{"function": 4, "start": 256, "regs": [{"reg": 0, "label": "Voltage"}, {"reg": 1, '
        '"label": "Power"}]},'
        ' {"function": 3, "start": 512, "regs": [{"reg": 0, "label": "Limit"}, {"reg": 4, "label": "Mode"}]}]}',
        ["input 256 u16 r Voltage", "input 257 u16 r Power", "holding 512 u16 Limit", "holding 516 u16 Mode"],
    ),
    "addresses that lie behind the start of their block": (
        "bus.json",
        '{"pollers": [{"type": "input", "start": 100, "data": [{"address": 100, "name": "Inner"}, '
        '{"address": 101, "name": "Outer"}]}, {"type": "holding", "start": 300, "data": [{"address": 304, '
        '"name": "Goal"}]}]}',
        ["input 100 u16 r Inner", "input 101 u16 r Outer", "holding 304 u16 Goal"],
    ),
    "rows of a source below their remark": (
        "Register.java",
        "/** Input registers (FC04) of the analyser. */\npublic enum Register {\n"
        '    CH4(0, "Methane", UINT16, 0.1, "%"),\n    CO2(1, "Carbon dioxide", UINT16, 0.1, "%"),\n'
        '    FLOW(4, "Gas flow", FLOAT32, 1.0, "m3/h");\n}\n',
        ["input 0 u16 x0.1 % r Methane", "input 1 u16 x0.1 % r Carbon dioxide", "input 4 f32 m3/h r Gas flow"],
    ),
    "names by their addresses": (
        "map.yml",
        "holding:\n  100: {name: Goal, type: int16, unit: K}\n  101: {name: Mode}\ncoils:\n  0: Enable\n  1: Boost\n",
        ["holding 100 s16 K Goal", "holding 101 u16 Mode", "coil 0 bool Enable", "coil 1 bool Boost"],
    ),
    "remarks above constants": (
        "regs.rs",
        "//! Holding registers of the drive.\n/// Speed, 0.1 rpm, u16\npub const SPEED: u16 = 0x0000;\n"
        "/// Current, 0.01 A, u16\npub const CURRENT: u16 = 0x0011;\n/// Energy, 0.1 kWh, u32\n"
        "pub const ENERGY: u16 = 0x12;\n",
        [
            "holding 0 u16 x0.1 rpm SPEED", "holding 17 u16 x0.01 A CURRENT", "holding 18 u32 x0.1 kWh ENERGY",
        ],
    ),
    "a structure of IEC 61131": (
        "DUT.st",
        "// input registers, first register at address 10\nTYPE Inputs : STRUCT\n    nFlow : UINT; // 0.1 m3/h\n"
        "    udTotal : UDINT; // m3\n    rLevel : REAL; // m\nEND_STRUCT\nEND_TYPE\n",
        ["input 10 u16 x0.1 m3/h r nFlow", "input 11 u32 m3 r udTotal", "input 13 f32 m r rLevel"],
    ),
    "an answer to a mail, the name before its register": (
        "re.eml",
        "From: a@b.example\nSubject: AW: Liste\n\nAlles Halteregister:\n\n"
        "> Vorlauf: Register 1, int16, Faktor 0,1, °C\n"
        "> Druck: Register 5, uint16, Faktor 0,01, bar\n> Laufzeit: Register 11, uint32, h\n",
        [
            "holding 1 s16 x0.1 °C Vorlauf", "holding 5 u16 x0.01 bar Druck", "holding 11 u32 h Laufzeit",
        ],
    ),
    "a mail in other signs": (
        "re.eml",
        "From: a@b.example\nSubject: list\nMIME-Version: 1.0\nContent-Type: text/plain; charset=utf-8\n"
        "Content-Transfer-Encoding: quoted-printable\n\n0x10: Flow=20temperature, int16, 0.1 =C2=B0C\n"
        "0x11: Return temperature, int16, 0.1 =C2=B0C\n",
        ["holding 16 s16 x0.1 °C Flow temperature", "holding 17 s16 x0.1 °C Return temperature"],
    ),
    "dots between names and addresses, and marks of pages": (
        "list.txt",
        "Holding registers\n\nFlow ............... 0    UINT16   0.1 m3/h\nTotal .............. 1-2  UINT32   1 m3\n"
        "                                   page 7\n\nPressure ........... 3    UINT16   0.01 bar\n"
        "Level .............. 4    UINT16   1 cm\n                                   page 8\n",
        [
            "holding 0 u16 x0.1 m3/h Flow", "holding 1 u32 m3 Total", "holding 3 u16 x0.01 bar Pressure",
            "holding 4 u16 cm Level",
        ],
    ),
    "lines that say each thing behind its name": (
        "list.log",
        "addr=16 name=Flow type=u16 scale=0.1 unit=l\naddr=17 name=Total type=u32 unit=m3\n"
        "addr=19 name=Mode type=u16 unit=-\n",
        ["holding 16 u16 x0.1 l Flow", "holding 17 u32 m3 Total", "holding 19 u16 Mode"],
    ),
    "fields behind their number": (
        "map.properties",
        "reg.0.name=Heat\nreg.0.type=int16\nreg.0.unit=C\nreg.10.name=Cycles\nreg.10.type=uint32\nreg.10.unit=x\n",
        ["holding 0 s16 C Heat", "holding 10 u32 x Cycles"],
    ),
    "a Turkish spreadsheet": (
        "liste.csv",
        "Adres;Açıklama;Birim\n5;Kazan suyu sıcaklığı;°C\n6;Çalışma saati;saat\n".encode("cp1254"),
        ["holding 5 u16 °C Kazan suyu sıcaklığı", "holding 6 u16 saat Çalışma saati"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", _FILES)
def test_what_a_file_says_of_all_its_values(kind: str) -> None:
    name, text, rows = _FILES[kind]
    check_import((name, text if isinstance(text, bytes) else text.encode(), rows, ""))


def test_what_was_read_before_changes_nothing() -> None:
    kinds = [(name, text if isinstance(text, bytes) else text.encode()) for name, text, _ in _FILES.values()]
    after_all = [row_texts(import_maps(name, data)[0]) for name, data in kinds]
    for (name, data), rows in zip(kinds[::4], after_all[::4], strict=True):
        vocabulary._words.cache_clear()
        for kept in (vocabulary._filled, vocabulary._lines, vocabulary.meaning, vocabulary.form):
            kept.cache_clear()
        assert row_texts(import_maps(name, data)[0]) == rows


_ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("page", ["README.md", "docs/fleet.md", "docs/tutorials/paste.md", "docs/ru/edge.md"])
def test_prose_is_refused_in_one_line(page: str) -> None:
    with pytest.raises(MapError, match="reads as prose") as said:
        import_maps(page, (_ROOT / page).read_bytes())
    assert "\n" not in str(said.value)
