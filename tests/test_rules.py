"""The numbers of the rules: rows that are others than the last release's have one that was raised since.

A release writes what its rules make: python tests/test_rules.py
"""

from __future__ import annotations

import hashlib
import json
import sys
import tempfile
from pathlib import Path

import pytest

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent / "support"))

from lakes import batch, rows, write_fleet

from analyzer.fleet.datasets import DATASETS
from analyzer.version import RULES, __version__

RELEASE = Path(__file__).parent / "rules_of_release.json"


def made(folder):
    """What this version's rules make of a small fleet: a digest of each table."""
    write_fleet(folder / "source", transactions=120)
    batch(folder / "lake", folder / "source")
    told = {table: [{**row, "version": ""} for row in rows(folder / "lake", table)] for table in DATASETS}
    digests = {table: hashlib.sha256(repr(told[table]).encode()).hexdigest()[:16] for table in DATASETS}
    return {"version": __version__, "rules": dict(RULES), "tables": digests}


def unraised(released, now):
    """Tables whose rows are others though none of the rules that make them has another number."""
    raised = {name for name, number in now["rules"].items() if released["rules"].get(name) != number}
    others = {table for table, digest in now["tables"].items() if released["tables"].get(table) != digest}
    return {table for table in others if not raised & set(DATASETS[table].rules)}


def test_rules_that_changed_have_another_number(tmp_path):
    released = json.loads(RELEASE.read_text(encoding="utf-8"))
    if released["version"] == __version__:
        pytest.skip(f"{__version__} itself is in the making: nothing is out to compare with")
    tables = unraised(released, made(tmp_path))
    assert not tables, (
        f"rows of {', '.join(sorted(tables))} are others than {released['version']} made: raise the number of the "
        "rules that changed, in analyzer/version.py"
    )


def test_a_change_without_a_number_is_seen(tmp_path):
    now = made(tmp_path)
    assert unraised(now, now) == set()
    other = {**now, "tables": {**now["tables"], "causes": "0"}}
    assert unraised(other, now) == {"causes"}
    for name in ("causes", "pairing"):
        assert unraised({**other, "rules": {**RULES, name: RULES[name] - 1}}, now) == set()
    assert unraised({**other, "rules": {**RULES, "findings": RULES["findings"] - 1}}, now) == {"causes"}


def test_rules_are_those_that_tables_name():
    assert {name for dataset in DATASETS.values() for name in dataset.rules} == set(RULES)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        RELEASE.write_text(json.dumps(made(Path(scratch)), indent=2) + "\n", encoding="utf-8")
