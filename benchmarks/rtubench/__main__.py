"""RTUBench from the command line.

python benchmarks/rtubench run                          the corpus of this year, every tool that is here, the table
python benchmarks/rtubench run --seed 2027 --size normal --json 2027.json
python benchmarks/rtubench run --tools rtuscope --tool 'mine=perl mine.pl' --tracks frames pairs
python benchmarks/rtubench check 'perl mine.pl'         does an adapter keep the protocol? what would it score?
python benchmarks/rtubench make FOLDER                  the corpus alone
python benchmarks/rtubench show 1.json 2.json ...       the table of figures that were written, also in parts
python benchmarks/rtubench compare 1.json 2.json ...    the same order? how far apart?
python benchmarks/rtubench setup                        installs modbus-connector in a place of its own
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rtubench import measured, speed, table, tools
from rtubench.items import Item, Row
from rtubench.made import corpus

YEAR = 2026
_VENVS = Path.home() / ".cache" / "rtubench"


def made(given: argparse.Namespace, folder: Path) -> list[Item]:
    """The corpus, written into the folder."""
    items = list(corpus.items(given.seed, corpus.SIZES[given.size]))
    if given.real:
        items += corpus.real(given.real)
    for item in items:
        item.write(folder)
    return items


def present(given: argparse.Namespace, folder: Path) -> tuple[list[tools.Tool], dict[str, str]]:
    """The tools that are asked for and here; why others are not."""
    commands = tools.known(given.venvs)
    names = commands if given.tools is None else given.tools
    wanted = {name: commands[name] for name in names}
    wanted |= {name: tuple(shlex.split(command)) for name, _, command in (one.partition("=") for one in given.tool)}
    found, absent = [], {}
    for name, command in wanted.items():
        try:
            found.append(tools.introduced(tuple(_absolute(part) for part in command), folder / "scratch"))
        except tools.NotThereError as error:
            absent[name] = str(error)
    return found, absent


def _absolute(part: str) -> str:
    """A file that is named from here, for adapters run in folders of their own."""
    return str(Path(part).resolve()) if Path(part).is_file() and "/" not in part[:1] else part


def run(given: argparse.Namespace, folder: Path) -> Row:
    """The corpus, tools, answers, scores."""
    items = made(given, folder)
    found, absent = present(given, folder)
    scored = []
    for tool in found:
        _tell(f"{tool.name}: answers")
        scored.append(measured.score(tool, items, folder, given.tracks, given.jobs))
    if "speed" in given.tracks:
        _tell("speed")
        size = corpus.SIZES[given.size]
        lines = [corpus.speed_item(given.seed, frames) for frames in size.speed]
        for item in lines:
            item.write(folder)
        fast = speed.measure([tool for tool in found if "speed" in tool.claims], lines, folder, given.rounds)
        for one in scored:
            figures = fast.get(one.tool.name, {})
            if isinstance(figures, str):
                one.wrong.append(figures)
            else:
                one.speed = figures
    _tell("")
    return {
        "bench": 1, "seed": given.seed, "size": given.size, "items": len(items), "machine": measured.machine(),
        "tools": [one.to_json(items) for one in scored], "absent": absent,
    }  # fmt: skip


def _tell(words: str) -> None:
    if sys.stderr.isatty():
        print(f"\r\x1b[K{words}", end="", file=sys.stderr, flush=True)


def _arguments(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="benchmarks/rtubench", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    doing = parser.add_subparsers(dest="doing", required=True, metavar="COMMAND")
    for name in ("run", "check", "make"):
        sub = doing.add_parser(name)
        sub.add_argument("--seed", type=int, default=YEAR, help=f"the year (default {YEAR})")
        sub.add_argument("--size", choices=corpus.SIZES, default="small")
        sub.add_argument("--real", type=Path, metavar="FOLDER", help="captures of real lines with their truth")
        sub.add_argument("--venvs", type=Path, default=_VENVS, help="where `setup` installs tools")
        sub.add_argument("--jobs", type=int, default=2, help="adapters at a time")
        sub.add_argument("--rounds", type=int, default=3, help="of the speed track: the least counts")
        sub.add_argument("--tracks", nargs="+", choices=tools.CLAIMS, default=list(tools.CLAIMS))
        sub.add_argument("--tools", nargs="+", choices=tools.known(_VENVS), help="these alone")
        sub.add_argument("--tool", action="append", default=[], metavar="NAME=COMMAND", help="an adapter of yours")
        sub.add_argument("--json", type=Path, metavar="FILE", help="write the figures for a program")
    doing.choices["check"].add_argument("adapter", help="the command of an adapter")
    doing.choices["make"].add_argument("folder", type=Path)
    doing.add_parser("show").add_argument("results", nargs="+", type=Path)
    doing.add_parser("compare").add_argument("results", nargs="+", type=Path)
    doing.add_parser("setup").add_argument("--venvs", type=Path, default=_VENVS)
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    given = _arguments(arguments)
    if given.doing == "setup":
        tools.set_up(given.venvs)
        return 0
    if given.doing == "compare":
        results = [json.loads(path.read_text()) for path in given.results]
        print(table.orders(results))
        print(table.differences(results[0], results[-1]))
        return 0
    if given.doing == "show":
        print(table.markdown(table.merged([json.loads(path.read_text()) for path in given.results])))
        return 0
    if given.doing == "make":
        given.folder.mkdir(parents=True, exist_ok=True)
        print(f"{len(made(given, given.folder))} items in {given.folder}")
        return 0
    if given.doing == "check":
        given.tools, given.tool, given.size = [], [f"yours={given.adapter}"], "tiny"
    with tempfile.TemporaryDirectory() as temporary:
        try:
            result = run(given, Path(temporary))
        except tools.AdapterError as error:
            print(f"rtubench: {error}", file=sys.stderr)
            return 1
    print(table.markdown(result))
    if given.json is not None:
        given.json.write_text(json.dumps(result, indent=1) + "\n")
    return int(not result["tools"] or any(tool["wrong"] for tool in result["tools"]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
