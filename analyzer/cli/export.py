"""`rtuscope export`: the frames of a capture, for other programs."""

from __future__ import annotations

import argparse

from .commands import DONE, FAILED, INTERRUPTED, NO_FRAME, UsageError
from .inputs import (
    add_capture_arguments,
    add_check_argument,
    add_columns_arguments,
    add_filter_argument,
    add_limit_arguments,
    add_map_argument,
    chosen_charts,
    chosen_filter,
    chosen_limits,
    load_functions,
    open_capture,
    tell_damage,
)
from .terminal import Progress, add_overwrite_argument, interruptible, tell_partial, tell_user, to_be_overwritten

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy
rtuscope export bus.jsonl -o frames.csv
rtuscope export bus.jsonl --filter 'exception or crc_ok == false'
rtuscope export bus.jsonl --format csv --fields time,unit,function,summary --count 10
rtuscope export bus.jsonl --noise --explain
rtuscope export bus.jsonl --table transactions -o polls.csv --delimiter ';'"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    add_capture_arguments(parser, format_flag=False)
    parser.add_argument(
        "-o", "-w", "--output", metavar="OUT", default="-", help="file to write; - is standard output (default)"
    )
    add_overwrite_argument(parser, "OUT")
    parser.add_argument(
        "--format",
        "--to-format",
        dest="format",
        metavar="F",
        help="jsonl, csv, mcap, parquet or pcapng; default: from OUT's suffix, else jsonl",
    )
    add_filter_argument(parser)
    add_map_argument(parser)
    parser.add_argument(
        "--table",
        default="frames",
        choices=("frames", "transactions", "values", "findings"),
        help="table to write (default: frames); others only as csv, jsonl or parquet",
    )
    add_columns_arguments(parser, "written")
    parser.add_argument(
        "--delimiter", default=",", metavar="C", help="CSV separator: , (default), ; or tab for spreadsheets"
    )
    parser.add_argument(
        "--bom", action="store_true", help="start CSV with a byte-order mark, so that Excel reads UTF-8"
    )
    parser.add_argument("--noise", action="store_true", help="also write the bytes between frames")
    parser.add_argument("--explain", action="store_true", help="explain each frame's boundaries")
    add_check_argument(parser)
    add_limit_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from ..exports import ExportOptions, export

    load_functions(arguments)
    limits = chosen_limits(arguments)
    capture = open_capture(arguments)
    charts = chosen_charts(arguments)
    chosen = chosen_filter(arguments, capture.line, charts)
    to_be_overwritten(arguments.output, overwrite=arguments.overwrite, source=capture.path)
    progress = Progress(f"export {arguments.capture}")
    with interruptible() as stop:
        result = export(
            capture,
            arguments.output,
            name=arguments.format,
            options=ExportOptions(
                explain=arguments.explain,
                noise=arguments.noise,
                filter=chosen,
                table=arguments.table,
                delimiter=_delimiter(arguments.delimiter),
                bom=arguments.bom,
                charts=charts or None,
                fields=arguments.fields,
                count=arguments.count,
            ),
            limits=limits,
            progress=progress,
            stop=stop,
        )
    progress.clear()
    tell_damage(arguments.capture, capture)
    if result.nothing:
        what = arguments.capture if arguments.output == "-" else f"{arguments.output}: not written"
        hint = "only bytes outside frames match the filter: --noise writes them"
        tell_user(f"{what}: {hint if result.bytes else 'nothing matches the filter'}")
        return INTERRUPTED if result.partial else NO_FRAME
    if result.partial:
        tell_partial(result.aside)
        return INTERRUPTED
    if not result.frames and chosen is None:
        tell_user(f"{arguments.capture}: no Modbus frame found in {result.bytes:,} bytes")
        return NO_FRAME
    if arguments.check and result.errors:
        tell_user(f"{arguments.capture}: {result.errors:,} findings of severity error")
        return FAILED
    return DONE


def _delimiter(text: str) -> str:
    delimiter = {"tab": "\t", "\\t": "\t"}.get(text, text)
    if len(delimiter) != 1 or delimiter in '"\r\n' or not delimiter.isascii():
        raise UsageError(f"--delimiter {text}: one character, or tab")
    return delimiter
