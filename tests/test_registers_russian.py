"""What registers mean in Russian: one catalogue has every word of it, with the same figures, and none stays English."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from string import Formatter

import pytest

import analyzer
from analyzer import languages
from analyzer.cli import main, registers
from analyzer.languages import fill, register_words
from analyzer.registers import checking, requests
from analyzer.registers.telling import AREAS, ROLES, STILL, told_name
from dissectors.maps.cells import COLUMN_NAMES
from dissectors.maps.table import HEADER_KEYS

_HOUSE = Path(analyzer.__file__).parent
_SOURCES = [*(_HOUSE / "registers").glob("*.py"), _HOUSE / "cli" / "registers.py", _HOUSE / "cli" / "map.py"]
_FIXED = (
    *registers.HEADINGS,
    *checking.KINDS,
    *requests.REQUEST_WORDS.values(),
    *ROLES,
    *STILL,
    *AREAS,
    *AREAS.values(),
)
_TERMS = re.compile(
    r"""[usf]\d+ | bcd\d+ | \b(?:[ABCD]{4}|BCD|SunSpec|SunS|float|text|bool|bits|enum|time|rtuscope|csv|yaml|jsonl)\b
    | [rb]\d+ | x\d | --[a-z]+ | [\w-]+@\d | \b[0-9A-F]{4}\b | '[^']*' | \b\d\S*e[+-]\d+ | \bs\b""",
    re.VERBOSE,
)


@pytest.fixture(autouse=True)
def _english() -> Iterator[None]:
    yield
    languages.use_language("en")


def _templates() -> Iterator[str]:
    """What the source hands to the catalogue: as it stands there, or by a name that was given it before."""
    for path in _SOURCES:
        for body in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(body, ast.FunctionDef):
                continue
            asked = [
                node.args[0]
                for node in ast.walk(body)
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "register_words"
            ]
            names = {node.id for node in asked if isinstance(node, ast.Name)}
            given = [
                each.value
                for each in ast.walk(body)
                if isinstance(each, ast.Assign)
                and names & {node.id for node in ast.walk(each.targets[0]) if isinstance(node, ast.Name)}
            ]
            for part in (*asked, *given):
                yield from _texts(part)


def _texts(node: ast.expr) -> Iterator[str]:
    """The texts that an expression may be: of a choice both, not what is chosen by."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _texts(node.body)
        yield from _texts(node.orelse)
    elif isinstance(node, ast.Tuple):
        for each in node.elts:
            yield from _texts(each)


def _places(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def test_every_template_is_in_the_catalogue_with_the_same_figures() -> None:
    known, asked = languages.catalogue("ru"), {*_templates(), *_FIXED}
    assert len(asked) > 70
    assert not asked - set(known["registers"])
    assert not set(known["registers"]) - asked, "told by nobody any more"
    for english, words in known["registers"].items():
        assert _places(words) == _places(english), english
        assert re.search("[а-я]", words), english
    assert set(known["columns"]) >= {*COLUMN_NAMES, *HEADER_KEYS}


def test_nouns_agree_with_their_number() -> None:
    fits = "{good:value|values} {good:|is as it|are as they} should be"
    assert [fill(fits, {"good": good}) for good in (1, 2)] == [
        "1 value is as it should be",
        "2 values are as they should be",
    ]
    languages.use_language("ru")
    said = [register_words(fits, good=good) for good in (1, 3, 11)]
    assert [words.split(" на")[0] for words in said] == ["1 значение похоже", "3 значения похожи", "11 значений похожи"]
    units = "weighed together with {units:unit|units}, asked the same and answering alike"
    assert "устройством 4:" in register_words(units, units=(4,)) and "устройствами 4, 5:" in register_words(
        units, units=(4, 5)
    )


def test_made_up_names_are_told_and_others_stay() -> None:
    languages.use_language("ru")
    names = ("measurement r107", "counter b3", "measurement of heat", "Voltage r1", "Напряжение")
    assert [*map(told_name, names)] == ["измерение r107", "счётчик b3", *names[2:]]


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("registers") / "bus.jsonl"
    rows = ("input,0,Напряжение,f32,CDAB,", "input,6,Ток,f32,,100", "input,900,Энергия,u32,,5")
    wrong = "\n".join(("area,address,name,type,order,max", *rows, ""))
    assert main(["simulate", str(path), "--map", "eastron-sdm120@1", "--transactions", "60"]) == 0
    path.with_name("wrong.csv").write_text(wrong, encoding="utf-8")
    return path


def _english_left(shown: str) -> set[str]:
    return set(re.findall(r"[A-Za-z]{2,}", _TERMS.sub(" ", shown)))


def test_commands_speak_russian(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong, draft = str(bus.with_name("wrong.csv")), str(bus.with_name("draft.csv"))
    data = {"Eastron", "SDM", "Modbus", "eastron", "sdm", "wrong", "draft"}
    for command, said in (
        (["registers", str(bus), "--all"], "регистр"),
        (["registers", str(bus), "--like", "225.6"], "показание 225,6"),
        (["map", "check", wrong, str(bus)], "1 противоречие у устройства 1"),
        (["map", "check", wrong], "3 значения, карта читается"),
        (["map", "infer", str(bus), "-o", draft], "значени"),
        (["map", "diff", wrong, wrong], "различий нет"),
        (["map", "show", wrong], "регистр ввода 900-901  u32 ABCD"),
    ):
        capsys.readouterr()
        main([*command, "--lang", "ru"])
        shown = capsys.readouterr().out
        assert said in shown, shown
        assert not _english_left(shown.replace(str(bus.parent), "")) - data, command


def test_facts_for_scripts_stay_as_they_are(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import json

    told = []
    for language in ("en", "ru"):
        capsys.readouterr()
        assert main(["registers", str(bus), "--json", "--lang", language]) == 0
        told.append([json.loads(line) for line in capsys.readouterr().out.splitlines()])
    assert any(value.pop("why") != other.pop("why") for value, other in zip(*told, strict=True))
    for value in (*told[0], *told[1]):
        value.pop("why", None)
    assert told[0] == told[1]
