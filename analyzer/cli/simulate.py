"""`rtuscope simulate`: a capture of a bus that never was, with the truth about it."""

from __future__ import annotations

import argparse

from .commands import DONE, UsageError
from .terminal import add_overwrite_argument, to_be_overwritten

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy --tap ftdi16 --seed 7
rtuscope simulate meter.jsonl --map eastron-sdm630@1 --map xy-md02@7
rtuscope simulate lost.jsonl --defect byte-missing
rtuscope report bus.jsonl"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    from ..simulation import TAPS, WIRES
    from ..simulation.defects import defects

    parser.add_argument(
        "output", metavar="OUT", help="capture to write, .jsonl or .mcap; its truth goes beside it, .truth.jsonl"
    )
    add_overwrite_argument(parser, "OUT or its truth")
    parser.add_argument(
        "--wire", choices=tuple(WIRES), default="clean", help="what the wire does to the frames (clean)"
    )
    parser.add_argument(
        "--defect",
        choices=tuple(defects()),
        metavar="CODE",
        help="one thing wrong on a healthy bus, again and again: the code of a finding (%(choices)s)",
    )
    parser.add_argument(
        "--map",
        metavar="MAP[@UNIT]",
        action="append",
        default=[],
        help="a server with this register map, a file or one of `rtuscope map list`; may be given again",
    )
    parser.add_argument("--tap", choices=tuple(TAPS), default="precise", help="how the tap tells times (precise)")
    parser.add_argument("--transactions", type=int, default=400, metavar="N", help="requests to make (400)")
    parser.add_argument("-b", "--baud", type=int, help="bit/s; drawn by chance if not given")
    parser.add_argument("--char-bits", type=int, default=11, help="start, data, parity and stop bits together (11)")
    parser.add_argument("--units", type=int, help="servers on the bus; drawn by chance if not given")
    parser.add_argument("--seed", type=int, default=0, help="the same seed gives the same bus (0)")


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from ..simulation import Scenario, write
    from ..simulation.bus import truth_path

    scenario = Scenario(
        arguments.wire,
        arguments.tap,
        transactions=arguments.transactions,
        seed=arguments.seed,
        baud=arguments.baud,
        char_bits=arguments.char_bits,
        units=arguments.units,
        defect=arguments.defect,
        maps=tuple(arguments.map),
    )
    for path in (arguments.output, truth_path(arguments.output)):
        to_be_overwritten(path, overwrite=arguments.overwrite)
    try:
        write(scenario, arguments.output)
    except ValueError as error:
        raise UsageError(str(error)) from error
    return DONE
