"""`rtuscope map`: register maps looked at, checked against traffic, imported, made and compared."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from ..extras import needs
from ..languages import column_name, counted, register_words
from .commands import DONE, FAILED, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    add_functions_argument,
    add_limit_arguments,
    add_reading_arguments,
    chosen_limits,
    known_name,
    load_functions,
    open_capture,
    unit_number,
)
from .lineoptions import add_kept_names
from .registers import RegisterTraffic, gathered
from .terminal import add_overwrite_argument, put_data, tell_user, to_be_overwritten

if TYPE_CHECKING:
    from dissectors.maps import RegisterMap
    from dissectors.maps.model import MappedValue

EXAMPLE = """\
rtuscope map list
rtuscope map show eastron-sdm630
rtuscope simulate meter.jsonl --map eastron-sdm630@1
rtuscope map check eastron-sdm630 meter.jsonl
rtuscope map infer meter.jsonl -o meter.csv --unit 1
rtuscope map diff eastron-sdm630 meter.csv
rtuscope map import meter.csv -o meter.yaml"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    actions = parser.add_subparsers(metavar="ACTION", title="actions", dest="action", required=True)
    listed = actions.add_parser("list", help="list the shipped maps")
    listed.add_argument("--json", action="store_true", help="one JSON object per line")
    show = actions.add_parser("show", help="print a map as a table")
    show.add_argument("map", metavar="MAP", help="a file, or the name of a shipped map")
    show.add_argument("--format", choices=("table", "csv", "yaml", "schema"), default="table", help="how to print it")
    check = actions.add_parser("check", help="check a map, alone or against a capture; exit status 1 on contradictions")
    check.add_argument("map", metavar="MAP[@UNIT]", help="a file, or the name of a shipped map")
    check.add_argument("capture", metavar="CAPTURE", nargs="?", help="capture to compare it with")
    check.add_argument("--unit", type=unit_number, metavar="N", help="the unit described by the map")
    check.add_argument("--json", action="store_true", help="one JSON object per remark, one per line")
    _capture_arguments(check)
    importing = actions.add_parser("import", help="import a map from a spreadsheet or another program's file")
    importing.add_argument("file", metavar="FILE", help="a table, or another program's file (rtuscope help registers)")
    _output_arguments(importing)
    form = importing.add_argument(
        "--input-format",
        type=_import_format,
        metavar="NAME",
        help="format of FILE, if its content does not show it",
    )
    add_kept_names(importing, form, "--format")
    importing.add_argument("--device", metavar="NAME", help="which device, if FILE has several")
    importing.add_argument("--base", type=int, metavar="N", help="the address where a SunSpec model begins")
    inferring = actions.add_parser("infer", help="infer a map from traffic")
    inferring.add_argument("capture", metavar="CAPTURE", help="a recording; - reads standard input")
    _output_arguments(inferring)
    inferring.add_argument("--unit", type=unit_number, metavar="N", help="the unit to map, if the bus has several")
    _capture_arguments(inferring)
    differ = actions.add_parser("diff", help="compare two maps")
    differ.add_argument("map", metavar="A", help="a file, or the name of a shipped map")
    differ.add_argument("other", metavar="B", help="the other map")


def run(arguments: argparse.Namespace) -> int:
    """Do the action."""
    action = {
        "list": _list, "show": _show, "check": _check, "import": _import, "infer": _infer, "diff": _diff,
    }[arguments.action]  # fmt: skip
    return action(arguments)


def _output_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", metavar="MAP", default="-", help="file to write, .csv or .yaml; - prints it")
    add_overwrite_argument(parser, "MAP")


def _capture_arguments(parser: argparse.ArgumentParser) -> None:
    add_reading_arguments(parser)
    add_functions_argument(parser)
    add_limit_arguments(parser)


def _list(arguments: argparse.Namespace) -> int:
    from dissectors.maps import shipped_map, shipped_names

    charts = [(name, shipped_map(name)) for name in shipped_names()]
    if arguments.json:
        import json

        for name, chart in charts:
            line = {"name": name, "vendor": chart.vendor, "device": chart.device, "values": len(chart.rows)}
            print(json.dumps({**line, "source": chart.source, "licence": chart.licence}, ensure_ascii=False))
        return DONE
    width = max(len(name) for name, _ in charts)
    for name, chart in charts:
        print(f"{name.ljust(width)}  {chart.called}, {_values(chart)}")
    return DONE


def _values(chart: RegisterMap) -> str:
    """How many a map has."""
    return counted(len(chart.rows), "value", "values")


def _show(arguments: argparse.Namespace) -> int:
    from dissectors.maps import map_text, read_map

    if arguments.format == "schema":
        import json

        from dissectors.maps.yamlform import json_schema

        put_data(f"{json.dumps(json_schema(), indent=2, ensure_ascii=False)}\n")
        return DONE
    chart = read_map(arguments.map)
    if arguments.format != "table":
        put_data(map_text(chart, f"x.{arguments.format}"))
        return DONE
    sys.stdout.write(_table(chart))
    return DONE


def _table(chart: RegisterMap) -> str:
    from analyzer.registers.telling import place_words
    from dissectors.maps.table import header_of
    from dissectors.values import harmless

    lines = [f"{column_name(key)}: {value}" for key, value in header_of(chart).items() if key != "address_base"]
    rows = []
    for row in chart.rows:
        order = f" {row.order}" if row.length > 1 and row.type != "text" else ""
        scale = f"x{row.scale:g}" if row.scale != 1 else ""
        states = ", ".join(f"{state} {name}" for state, name in row.values.items())
        rows.append(
            (
                place_words(row.area, row.address, row.length),
                f"{row.type}{order}",
                row.name,
                f"{scale} {row.unit}".strip(),
                row.access,
                "; ".join(
                    part
                    for part in (
                        _limits(row),
                        states,
                        _writers(row),
                        f"= {row.formula}" * bool(row.formula),
                        row.description,
                    )
                    if part
                ),
            )
        )
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    lines += [
        "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths, strict=False)), row[-1]]).rstrip()
        for row in rows
    ]
    return "".join(f"{harmless(line)}\n" for line in lines)


def _limits(row: MappedValue) -> str:
    """The limits of a number, in its unit of measure; states have none of their own."""
    if row.values or (row.minimum is None and row.maximum is None):
        return ""
    if row.minimum is None or row.maximum is None:
        words, limit = ("to {limit:g}", row.maximum) if row.minimum is None else ("from {limit:g}", row.minimum)
        return register_words(words, limit=limit)
    return register_words("{low:g} to {high:g}", low=row.minimum, high=row.maximum)


def _writers(row: MappedValue) -> str:
    """The functions that write a value, where not all do."""
    codes = ", ".join(f"{code:02d}" for code in row.written_by)
    return register_words("written by {functions}", functions=codes) if codes else ""


def _check(arguments: argparse.Namespace) -> int:
    from analyzer.registers.checking import KINDS, check_map, overlaps
    from analyzer.registers.requests import request_remarks
    from analyzer.registers.telling import unit_place
    from dissectors.maps import map_for_unit
    from dissectors.values import harmless

    chart, unit = map_for_unit(arguments.map)
    unit = arguments.unit if arguments.unit is not None else unit
    for line in overlaps(chart):
        if arguments.json:
            tell_user(f"overlap: {line}")
        else:
            print(harmless(register_words("overlap: {words}", words=line)))
    if arguments.capture is None:
        if not arguments.json:
            words = "{name}: {values}, readable"
            print(harmless(register_words(words, name=chart.device or arguments.map, values=_values(chart))))
        return DONE
    traffic = _traffic(arguments)
    if not traffic.units:
        return NO_FRAME
    charts = _chart_of(chart, unit, traffic)
    remarks = [*check_map(traffic.readings, charts), *request_remarks(traffic.asked, charts)]
    remarks.sort(key=lambda remark: KINDS.index(remark.kind))
    wrong = sum(remark.kind == "contradiction" for remark in remarks)
    if arguments.json:
        import json

        for remark in remarks:
            print(json.dumps(remark.to_json(), ensure_ascii=False))
    else:
        for remark in remarks:
            place = unit_place(remark.unit, remark.area, remark.address, remark.words)
            where = f"{place} {remark.name}" if remark.name else place
            print(harmless(f"{register_words(remark.kind)}: {where}: {remark.text}"))
        contradictions = counted(wrong, "contradiction", "contradictions")
        words = "{contradictions} in unit {unit}"
        print(register_words(words, contradictions=contradictions, unit=", ".join(map(str, charts))))
    if traffic.stopped:
        return INTERRUPTED
    return FAILED if wrong else DONE


def _traffic(arguments: argparse.Namespace) -> RegisterTraffic:
    """What the capture's registers were; why there is nothing of them goes to standard error."""
    load_functions(arguments)
    capture = open_capture(arguments)
    traffic = gathered(capture, arguments.capture, chosen_limits(arguments), command="map")
    if not traffic.units:
        what = "no response carries register values" if traffic.readings.frames else "no Modbus frame found"
        tell_user(f"{arguments.capture}: {what}")
    return traffic


def _chart_of(chart: RegisterMap, unit: int | None, traffic: RegisterTraffic) -> dict[int, RegisterMap]:
    """The unit that the map is of: the one that was named, the only one, or the one that fits it best."""
    from analyzer.registers.recognition import chart_evidence

    units = traffic.units
    if unit is not None:
        if unit not in units:
            raise UsageError(
                f"no response from unit {unit} carries a value: units with values: {', '.join(map(str, units))}"
            )
        return {unit: chart}
    if len(units) == 1:
        return {units[0]: chart}
    scores = {
        number: chart_evidence(
            chart,
            [block for block in traffic.readings if block.unit == number],
            {which: text for (owner, which), text in traffic.texts.texts.items() if owner == number},
        ).bits
        for number in units
    }
    best = max(scores, key=lambda number: scores[number])
    if scores[best] <= 0:
        raise UsageError(f"which unit is this map for? Add --unit N: units with values: {', '.join(map(str, units))}")
    tell_user(f"used as the map of unit {best}, the best match (--unit N overrides this)")
    return {best: chart}


def _import_format(text: str) -> str:
    """The name of a format that maps are imported from; for argparse."""
    from dissectors.maps.importers import FORMATS, map_format

    return known_name(text, map_format, "map format", lambda: FORMATS)


def _import(arguments: argparse.Namespace) -> int:
    from pathlib import Path

    from dissectors.maps.files import map_bytes
    from dissectors.maps.importers import import_maps
    from dissectors.maps.importers.sunspec import moved
    from dissectors.maps.model import MissingLibraryError

    path = Path(arguments.file)
    to_be_overwritten(arguments.output, overwrite=arguments.overwrite, source=path)
    _check_suffix(arguments.output)
    data = map_bytes(path)
    try:
        imported = import_maps(arguments.file, data, name=arguments.input_format)
    except MissingLibraryError as missing:
        raise UsageError(needs(missing.what, missing.library, missing.extra)) from missing
    names = [one.chart.device for one in imported]
    if arguments.device is not None:
        imported = [one for one in imported if one.chart.device == arguments.device]
        if not imported:
            raise UsageError(f"--device {arguments.device!r}: {arguments.file} has {', '.join(map(repr, names))}")
    elif len(imported) > 1:
        others = ", ".join(map(repr, names))
        tell_user(f"{arguments.file} has {len(imported)} devices; using {names[0]!r}; --device chooses among {others}")
    chosen = imported[0] if arguments.base is None else moved(imported[0], arguments.base)
    for note in chosen.notes:
        tell_user(note)
    _write(chosen.chart, arguments.output)
    return DONE


def _infer(arguments: argparse.Namespace) -> int:
    from pathlib import Path

    from analyzer.registers.drafting import drafted_map
    from analyzer.registers.inference import infer

    file = None if arguments.capture == "-" else Path(arguments.capture)
    to_be_overwritten(arguments.output, overwrite=arguments.overwrite, source=file)
    _check_suffix(arguments.output)
    traffic = _traffic(arguments)
    units = traffic.units
    if not units:
        return NO_FRAME
    unit = arguments.unit
    if unit is None and len(units) > 1:
        raise UsageError(f"which unit? Add --unit N: units with values: {', '.join(map(str, units))}")
    unit = units[0] if unit is None else unit
    if unit not in units:
        raise UsageError(
            f"no response from unit {unit} carries a value: units with values: {', '.join(map(str, units))}"
        )
    values = infer(traffic.readings, units=[unit])
    source = register_words("inferred from {file}", file=Path(arguments.capture).name)
    chart = drafted_map(values, register_words("unit {unit}", unit=unit), source)
    if not chart.rows:
        tell_user(f"{arguments.capture}: nothing can be inferred from the registers of unit {unit}")
        return NO_FRAME
    _write(chart, arguments.output)
    return INTERRUPTED if traffic.stopped else DONE


def _diff(arguments: argparse.Namespace) -> int:
    from analyzer.registers.drafting import map_differences
    from dissectors.maps import read_map
    from dissectors.values import harmless

    lines = list(map_differences(read_map(arguments.map), read_map(arguments.other)))
    for line in lines or [register_words("no differences")]:
        print(harmless(line))
    return DONE


def _check_suffix(path: str) -> None:
    """A map is written as CSV or YAML: what its name says."""
    from pathlib import PurePath

    if path != "-" and PurePath(path).suffix.lower() not in (".csv", ".yaml", ".yml"):
        raise UsageError(f"-o {path}: a map must be a .csv or .yaml file")


def _write(chart: RegisterMap, path: str) -> None:
    from analyzer.exports.sink import output
    from dissectors.maps import map_text
    from dissectors.values import harmless

    with output(path) as file:
        file.write(map_text(chart, path).encode())
    if path != "-":
        print(harmless(f"{path}: {_values(chart)}"))
