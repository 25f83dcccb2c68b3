"""What takes files away: one module, and never anything that this program did not make.

The product's source is searched for whatever else could; folders full of a user's files are given to `batch -o`.
"""

from __future__ import annotations

import ast
import os
import stat
from pathlib import Path
from random import Random

import pytest

import captures
from analyzer.cli import main
from captures.disposal import TemporaryFolder, made, remove_listed, remove_made, remove_proven

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")

from lakes import batch, bus, ring

from analyzer.fleet import FleetError
from analyzer.fleet.batch import compact_lake
from analyzer.fleet.manifest import Manifest
from analyzer.fleet.stores import FolderStore, store

ROOT = Path(__file__).parents[1]
HOME = ROOT / "captures" / "disposal.py"
SOURCE = [path for package in ("analyzer", "captures", "dissectors") for path in (ROOT / package).rglob("*.py")]
# What takes away, empties or writes over, by the name that it is called by; each of `os` and `shutil`, and of paths.
MODULES = {"os", "shutil", "tempfile"}
OF_MODULES = {
    "remove",
    "removedirs",
    "replace",
    "renames",
    "truncate",
    "ftruncate",
    "move",
    "rmtree",
    "link",
    "symlink",
}
OF_MODULES |= {"mkstemp", "mkdtemp", "TemporaryDirectory", "NamedTemporaryFile", "copyfile", "copy2"}
OF_ANYTHING = {"unlink", "rmdir", "rename", "rm", "rm_file", "rmtree", "delete_dir", "hardlink_to", "symlink_to"}
OF_ANYTHING |= {"write_text", "write_bytes", "touch", "mv", "rm_files"}
FLAGS = {"O_TRUNC"}
MODES = set("wa+")


def destroying(tree: ast.AST) -> list[str]:
    """What in a module could take away, empty or write over a file: the line and the call."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module in MODULES:
            names = {each.name for each in node.names} & (OF_MODULES | OF_ANYTHING)
            found += [f"{node.lineno}: from {node.module} import {name}" for name in names]
        elif isinstance(node, ast.Attribute):
            module = isinstance(node.value, ast.Name) and node.value.id in MODULES
            if node.attr in OF_ANYTHING | FLAGS or (module and node.attr in OF_MODULES):
                found.append(f"{node.lineno}: {ast.unparse(node)}")
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute | ast.Name):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id
            texts = [each.value for each in ast.walk(node) if isinstance(each, ast.Constant)]
            modes = [each for each in texts if isinstance(each, str) and each and set(each) <= set("rwaxbt+")]
            if name == "open" and any(set(mode) & MODES for mode in modes):
                found.append(f"{node.lineno}: {ast.unparse(node)}")
            if name == "replace" and len(node.args) == 1 and not node.keywords:  # a path's: a text's has two
                found.append(f"{node.lineno}: {ast.unparse(node)}")
    return found


def test_one_module_takes_files_away() -> None:
    assert len(SOURCE) > 300 and destroying(ast.parse(HOME.read_text("utf-8")))
    found = {
        path.relative_to(ROOT).as_posix(): [call.partition(": ")[2] for call in destroying(tree)]
        for path in SOURCE
        if path != HOME and destroying(tree := ast.parse(path.read_text("utf-8")))
    }
    assert found == ALLOWED


ALLOWED = {
    "analyzer/fleet/stores.py": ["path.open('rb+')"],  # to put its bytes on the disk, not to change them
    "captures/live/confinement.py": ["os.O_TRUNC"],  # a bit that it forbids
    "analyzer/terminal_text.py": ["open(os.devnull, 'w', encoding='utf-8', errors='replace')"],
}


@pytest.mark.parametrize(
    "line",
    [
        "path.unlink()",
        "os.remove(path)",
        "from shutil import rmtree",
        "shutil.rmtree(folder, ignore_errors=True)",
        "path.replace(target)",
        "os.replace(path, target)",
        "path.rename(target)",
        "path.open('wb')",
        "open(path, 'a')",
        "path.open(mode='r+b')",
        "os.open(path, os.O_WRONLY | os.O_TRUNC)",
        "path.write_bytes(b'')",
        "system.rm_file(path)",
        "tempfile.mkdtemp()",
        "os.ftruncate(descriptor, 0)",
    ],
)
def test_the_search_finds_what_it_is_for(line: str) -> None:
    assert destroying(ast.parse(line))


@pytest.mark.parametrize(
    "line", ["text.replace('a', 'b')", "path.open('rb')", "names.remove(name)", "path.open('xb')", "replace(row, a=1)"]
)
def test_the_search_lets_go_what_takes_nothing_away(line: str) -> None:
    assert not destroying(ast.parse(line))


def snapshot(*folders: Path) -> dict[str, object]:
    """All that is in these folders: contents of files, where links lead."""
    seen: dict[str, object] = {}
    for path in (inner for folder in folders for inner in folder.rglob("*")):
        kind = path.lstat().st_mode
        seen[str(path)] = str(path.readlink()) if stat.S_ISLNK(kind) else stat.S_ISDIR(kind) or path.read_bytes()
    return seen


FOLDERS = ("captures", "frames", "values", "state", "scratch", "account", "manifest", "hours", "findings", "mine")
RUN = "0123456789abcdef" * 2
NAMES = (
    "monday.jsonl",
    "notes.txt",
    "00000001.json",
    "00000001 (copy).json",
    f"{RUN}.json",
    f"rows-{RUN}-1.part",
    f"0123456789ab-{RUN}-1.parquet",
    "0123456789ab-0123456789ab.parquet",
    f"{'ab' * 16}.part",
    ".writing",
    "lake.json",
)


def user_tree(folder: Path, outside: Path, chance: Random) -> None:
    """Files and links of a user's, many with names that a lake's files have, in places that a lake has."""
    folder.mkdir(exist_ok=True)
    for _ in range(chance.randint(1, 25)):
        place = folder / chance.choice((".", *FOLDERS))
        for deeper in ("site=site0", "site=s", "packed")[: chance.randint(0, 2)]:
            place /= deeper
        if chance.random() < 0.2:
            place.parent.mkdir(parents=True, exist_ok=True)
            if not os.path.lexists(place):
                place.symlink_to(chance.choice((outside, outside / "frames", folder)), target_is_directory=True)
            continue
        place.mkdir(parents=True, exist_ok=True)
        path = place / chance.choice(NAMES)
        if os.path.lexists(path):
            continue
        if chance.random() < 0.2:
            path.symlink_to(outside / "precious.txt")
        else:
            path.write_bytes(chance.randbytes(20) if chance.random() < 0.7 else b"{}")


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    path = tmp_path_factory.mktemp("source") / "site0" / "bus.jsonl"
    path.parent.mkdir()
    captures.write(path, bus("clean", 1, 4))
    return path


def beyond(tmp_path: Path, chance: Random) -> Path:
    """A folder outside of the lake to which links lead, as a lake inside."""
    outside = tmp_path / "outside"
    for name in ("precious.txt", f"frames/0123456789ab-{RUN}-1.parquet", "state/notes", "site=site0/frames.txt"):
        path = outside / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(chance.randbytes(9))
    return outside


@pytest.mark.skipif(os.name != "posix", reason="makes links")
@pytest.mark.parametrize("seed", range(100))
def test_no_file_of_a_user_is_gone_whatever_folder_is_given(seed, source, tmp_path, capsys):
    """Half of them no lakes, which are refused; half lakes into which the user put files and links."""
    chance = Random(seed)
    outside, folder = beyond(tmp_path, chance), tmp_path / "project"
    if seed % 2:
        batch(folder, source)
        entered = {path for path in folder.rglob("*") if path.is_file()}
    user_tree(folder, outside, chance)
    before = snapshot(tmp_path)
    if seed % 2:
        own = {str(path) for path in entered}
        before = {name: content for name, content in before.items() if name not in own}
    words = [
        ["batch", str(source), "-o", str(folder), "--workers", "1"],
        ["batch", str(source), "-o", str(folder), "--workers", "1", "--resume", "--redo", "--noise"],
        ["batch", "-o", str(folder), "--compact"],
        ["watch", str(folder), "--from", str(source), "--once", "--workers", "1"],
    ]
    for command in chance.sample(words, 2):
        status = main(command)
        said = capsys.readouterr().err
        assert "Traceback" not in said and "defect" not in said
        assert status == 2 or seed % 2
    after = snapshot(tmp_path)
    lost = {name for name, content in before.items() if after.get(name) != content}
    assert not lost
    if not seed % 2:
        assert after == before  # and nothing was put there


def test_a_capture_inside_the_lake_is_refused(source, tmp_path, capsys):
    lake = tmp_path / "lake"
    batch(lake, source)
    inside = lake / "captures" / "monday.jsonl"
    inside.write_bytes(source.read_bytes())
    link = tmp_path / "link.jsonl"
    link.symlink_to(inside)
    for place in (inside, link, lake):
        assert main(["batch", str(place), "-o", str(lake), "--resume"]) == 2
        assert "is inside the lake" in capsys.readouterr().err
    assert main(["watch", str(lake), "--from", str(inside), "--once"]) == 2
    assert inside.read_bytes() == source.read_bytes()


def test_what_a_lake_does_not_know_is_told_and_stays(source, tmp_path):
    lake = tmp_path / "lake"
    batch(lake, source)
    mine = lake / "frames" / "mine.parquet"
    mine.write_bytes(b"mine")
    result = batch(lake, source)
    assert mine.read_bytes() == b"mine"
    assert any(
        "kept files that were not written by this lake: 1 (the first: frames/mine.parquet)" in t
        for t in result.troubles
    )


def test_what_was_replaced_or_left_by_a_killed_run_goes(tmp_path):
    _, paths = ring(tmp_path)
    lake = tmp_path / "lake"
    batch(lake, *paths[:2])
    first = set(lake.rglob("*.parquet"))
    run = FolderStore(str(lake))
    left = run.scratch()
    left.write_bytes(b"of a killed task")
    placed = lake / run.fresh("frames/site=site/day=2026-01-01/0123456789ab", ".parquet")
    placed.parent.mkdir(parents=True)
    placed.write_bytes(b"put, and not entered")
    batch(lake, *paths)
    assert not left.exists() and not placed.exists()
    batch(lake, *paths)
    compact_lake(store(str(lake)))
    batch(lake, *paths)
    named = Manifest(store(str(lake))).named()
    assert {path.relative_to(lake).as_posix() for path in lake.rglob("*.parquet")} == {
        n for n in named if "parquet" in n
    }
    assert first - set(lake.rglob("*.parquet"))


def test_a_lake_of_before_there_was_an_account_goes_on(source, tmp_path):
    lake = tmp_path / "lake"
    batch(lake, source)
    (lake / "lake.json").unlink()
    for path in (lake / "account").iterdir():
        path.unlink()
    result = batch(lake, source)
    assert (result.skipped, result.troubles) == (1, [])
    assert (lake / "lake.json").exists()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"null",
        b"[]",
        b"{}",
        b"[" * 100_000,
        b'{"packs": 7}',
        b'{"packs": [{"table": "frames", "name": "../../mine.parquet", "members": []}]}',
        b'{"site": 1}',
        "truncated",
        "wrong kind",
        "outside",
    ],
    ids=lambda content: str(content)[:12],
)
def test_a_damaged_entry_is_told_in_a_line(content, source, tmp_path, capsys):
    import json

    lake = tmp_path / "lake"
    batch(lake, source)
    entry = lake / "manifest" / "00000001.json"
    whole = entry.read_bytes()
    about = json.loads(whole)
    if content == "truncated":
        content = whole[: len(whole) // 2]
    elif content == "wrong kind":
        about["files"]["frames"] = {"a": 3}
        content = json.dumps(about).encode()
    elif content == "outside":
        about["files"]["frames"] = [["../../outside.parquet", 3]]
        content = json.dumps(about).encode()
    entry.write_bytes(content)
    for words in (["ask", str(lake), "damaged"], ["batch", str(source), "-o", str(lake), "--resume"]):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1 and "00000001.json: is damaged" in said
    entry.write_bytes(whole)
    assert main(["ask", str(lake), "damaged"]) == 0


def test_any_part_of_an_entry_may_be_damaged(source, tmp_path):
    """Each value of an entry in turn is another kind of value, or gone: told, or of no consequence; never a defect."""
    import json

    lake = tmp_path / "lake"
    batch(lake, source)
    entry = lake / "manifest" / "00000001.json"
    whole = json.loads(entry.read_bytes())
    refused = 0
    for key in whole:
        for value in (None, 7, "x", [7], {"x": 7}, [["a", "b"]], "gone"):
            spoilt = {**whole, key: value}
            if value == "gone":
                del spoilt[key]
            entry.write_text(json.dumps(spoilt))
            try:
                manifest = Manifest(store(str(lake)))
                manifest.named()
                [manifest.files(table).names for table in ("frames", "captures")]
                batch(lake, source)
            except FleetError:
                refused += 1
            finally:
                for path in (lake / "manifest").glob("0000000[2-9].json"):
                    path.unlink()
    assert refused > 40


@pytest.mark.skipif(os.name != "posix", reason="makes links")
def test_files_of_an_account_go_and_none_behind_a_link(tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "mine").write_text("mine")
    root = tmp_path / "root"
    (root / "in").mkdir(parents=True)
    (root / "in" / "ours").write_text("ours")
    (root / "in" / "link").symlink_to(outside / "mine")
    (root / "out").symlink_to(outside)
    kept = remove_listed(root, ["in/ours", "in/link", "out/mine", "../outside/mine", "in", "gone/too", "/in/ours"])
    assert set(kept) == {"in/link", "out/mine", "../outside/mine", "in", "/in/ours"}
    assert kept["out/mine"] == "reached through a link"
    assert (outside / "mine").read_text() == "mine" and not (root / "in" / "ours").exists()


def test_a_file_that_was_made_here_goes_only_as_itself(tmp_path):
    path = tmp_path / "file"
    path.write_text("ours")
    mine = made(path)
    path.rename(tmp_path / "moved")
    path.write_text("another's")
    assert not remove_made(path, mine) and path.exists()
    assert remove_made(tmp_path / "moved", mine)
    assert not remove_made(tmp_path / "nothing", mine)
    assert not remove_proven(path, lambda content: content == b"ours") and path.exists()


def test_a_temporary_folder_leaves_what_links_lead_to(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes").write_text("mine")
    with TemporaryFolder("test-", tmp_path) as folder:
        (folder / "link").symlink_to(tmp_path / "mine")
    assert not folder.exists() and (tmp_path / "mine" / "notes").exists()
    kept = TemporaryFolder("test-", tmp_path)
    kept.path.rename(tmp_path / "moved")
    kept.path.mkdir()
    (kept.path / "notes").write_text("mine")
    kept.remove()
    assert (kept.path / "notes").exists()


def test_what_appears_under_the_name_meanwhile_is_not_written_over(tmp_path):
    path = tmp_path / "out.csv"
    told = pytest.raises(
        captures.CaptureError, match=r"another program created it meanwhile; the output is in .*out-2\.csv"
    )
    with told, captures.replacing(path) as out:
        out.write(b"an hour of work")
        path.write_bytes(b"mine")
    assert (path.read_bytes(), (tmp_path / "out-2.csv").read_bytes()) == (b"mine", b"an hour of work")
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    "content",
    [
        "#!/bin/sh\nexec true\n",
        "wireshark extcap\n",
        '#!/bin/sh\nrm -r x\nexec python -m analyzer.cli wireshark extcap "$@"\n',
    ],
)
def test_wireshark_remove_takes_only_our_script_away(content, tmp_path, capsys):
    script = tmp_path / ("rtuscope.bat" if os.name == "nt" else "rtuscope")
    script.write_text(content)
    for action in ("install", "remove"):
        assert main(["wireshark", action, "--folder", str(tmp_path)]) == 2
        assert "not made by rtuscope" in capsys.readouterr().err and script.read_text() == content
    script.unlink()
    assert main(["wireshark", "install", "--folder", str(tmp_path)]) == 0
    assert main(["wireshark", "install", "--folder", str(tmp_path)]) == 0
    assert main(["wireshark", "remove", "--folder", str(tmp_path)]) == 0 and not script.exists()
