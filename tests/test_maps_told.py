"""What a table says in any language: by what stands in its columns, and by fragments of names and remarks."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from oddmaps import row_texts

from dissectors.maps.facts import facts_in_remark, name_apart
from dissectors.maps.importers import import_maps

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))


@pytest.mark.parametrize(
    ("text", "name", "told"),
    [
        ("Line voltage (x0.1 V, signed)", "Line voltage", {"scale": "0.1", "unit": "V", "sign": "signed"}),
        ("Temperatura mandata, 0,001 °C", "Temperatura mandata", {"scale": "0.001", "unit": "°C"}),
        ("Tilt (1 LSB = 0.01°)", "Tilt", {"scale": "0.01", "unit": "°"}),
        ("Counter (total)", "Counter (total)", {}),
    ],
)
def test_what_stands_behind_a_name(text: str, name: str, told: dict[str, str]) -> None:
    assert name_apart(text) == (name, told)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("signed, raw / 10 = °C", {"scale": "1/10", "unit": "°C", "sign": "signed"}),
        ("value = raw * 0,01", {"scale": "0.01"}),
        ("0,1 °C par unité", {"scale": "0.1", "unit": "°C"}),
        ("Auflösung: 0,5 K", {"scale": "0.5", "unit": "K"}),
        ("tenths of °C", {"scale": "1/10", "unit": "°C"}),
        ("10⁻² V", {"scale": "1e-2", "unit": "V"}),
        ("0 closed, 1 open", {}),
        ("see chapter 4", {}),
    ],
)
def test_what_a_remark_tells(text: str, told: dict[str, str]) -> None:
    assert facts_in_remark(text) == told


FILES = {
    "rights and lengths below words that nobody knows": (
        "x.csv",
        "ᎠᎡᎢ,ᎣᎤᎥ,ᎦᎧᎨ,ᎩᎪᎫ\n100,Power,2,O/Í\n102,Flow,1,O\n103,Total,2,O\n106,Level,1,O/Í\n",
        ["holding 100 u32 rw Power", "holding 102 u16 r Flow", "holding 103 u32 r Total", "holding 106 u16 rw Level"],
    ),
    "a table of Jira": (
        "x.txt",
        "h3. Input registers\n||Register||Name||Type||\n|5|Level|U16|\n|6|Flow|F32|\n",
        ["input 5 u16 r Level", "input 6 f32 r Flow"],
    ),
    "addresses from 1 on, as a remark in a source says": (
        "x.py",
        '# Addresses start at 1.\nREGS = [\n    {"address": 1, "name": "Level"},\n'
        '    {"address": 3, "name": "Flow"},\n]\n',
        ["holding 0 u16 Level", "holding 2 u16 Flow"],
    ),
    "records with our keys that are not of our form": (
        "x.yaml",
        "registers:\n  - {address: '0x10', name: Level, scale: 10^-1}\n"
        "  - {address: '0x11', name: Flow, scale: 10^-2}\n",
        ["holding 16 u16 x0.1 Level", "holding 17 u16 x0.01 Flow"],
    ),
    "types that say that they have a sign beside those that do not": (
        "x.csv",
        "Adresse;Nom;Type\n1;Soufflage;entier signé 16 bits\n2;Débit;entier 16 bits\n3;Énergie;entier 32 bits\n",
        ["holding 1 s16 Soufflage", "holding 2 u16 Débit", "holding 3 u32 Énergie"],
    ),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_whose_columns_tell(kind: str) -> None:
    name, text, expected = FILES[kind]
    (found,) = import_maps(name, text.encode())
    assert row_texts(found) == expected


def test_tables_stay_the_same_below_unknown_headings_in_another_order() -> None:
    from map_files import made_files
    from restyled_maps import stay_right

    found = stay_right(file for file in made_files(1) if file.fold in ("new", "late"))
    assert {*found} == {"new", "late"}
    assert all(after == before > 0 for after, before in found.values())


def test_one_factor_of_ten_for_all_is_said_to_be_a_guess() -> None:
    rows = "Address,Name,Unit,Scale\n" + "".join(f"{at},Sensor {at},°C,10\n" for at in range(1, 6))
    (found,) = import_maps("factors.csv", rows.encode())
    assert any(note.startswith("factors of 10 or more were taken as multipliers") for note in found.notes)
