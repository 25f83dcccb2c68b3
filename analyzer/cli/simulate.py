"""`rtuscope simulate`: a capture of a bus that never was, with the truth about it."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from .commands import DONE, UsageError
from .lineoptions import LineWords, add_line_arguments
from .terminal import add_overwrite_argument, tell_user, to_be_overwritten

if TYPE_CHECKING:
    from ..simulation import Scenario

EXAMPLE = """\
rtuscope simulate bus.jsonl --wire noisy --tap ftdi16 --seed 7
rtuscope simulate meter.jsonl --map eastron-sdm630@1 --map xy-md02@7
rtuscope simulate lost.jsonl --defect byte-missing
rtuscope simulate silent.jsonl --cause dead-unit --seed 3
rtuscope report silent.jsonl"""


_TRANSACTIONS = 400
_CHAR_BITS = 11
_LINE_WORDS = LineWords(baud="bit/s, or with its format: 19200-8N1 (default: random)")


def configure(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    from ..simulation import TAPS, WIRES
    from ..simulation.causes import cases_by_cause, other_cases
    from ..simulation.defects import defects

    parser.add_argument(
        "output", metavar="OUT", help="capture to write, .jsonl or .mcap; its truth goes beside it, .truth.jsonl"
    )
    add_overwrite_argument(parser, "OUT or its truth")
    parser.add_argument(
        "--wire",
        choices=tuple(WIRES),
        help="a client that asks for everything, and what the wire does to the frames (default: a healthy bus)",
    )
    parser.add_argument(
        "--defect",
        choices=tuple(defects()),
        metavar="CODE",
        help="one recurring fault on a healthy bus: the code of a finding (%(choices)s)",
    )
    parser.add_argument(
        "--cause",
        choices=(*cases_by_cause(), *other_cases()),
        metavar="CODE",
        help="a site chosen by the seed with this cause: a code from `rtuscope help causes`, or healthy",
    )
    parser.add_argument(
        "--map",
        metavar="MAP[@UNIT]",
        action="append",
        default=[],
        help="a server with this register map, a file or one of `rtuscope map list`; repeatable",
    )
    parser.add_argument("--tap", choices=tuple(TAPS), default="precise", help="how the tap timestamps bytes (precise)")
    parser.add_argument("--transactions", type=int, metavar="N", help="requests to make (400)")
    add_line_arguments(parser, _LINE_WORDS)
    parser.add_argument("--char-bits", type=int, help="bits per character, including start, parity and stop (11)")
    parser.add_argument("--units", type=int, help="number of servers on the bus (default: random)")
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="the same seed gives the same bus, whatever the fault or tap (0)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from ..simulation import write
    from ..simulation.bus import truth_path
    from ..simulation.causes import write_cause

    if arguments.cause is not None:
        _refuse_what_is_drawn(arguments)
    truth = truth_path(arguments.output)
    for path in (arguments.output, truth):
        to_be_overwritten(path, overwrite=arguments.overwrite)
    try:
        if arguments.cause is not None:
            write_cause(arguments.cause, arguments.output, tap=arguments.tap, seed=arguments.seed)
        else:
            write(_scenario(arguments), arguments.output)
    except ValueError as error:
        raise UsageError(str(error)) from error
    tell_user(f"wrote {arguments.output} and its ground truth {truth}")
    return DONE


def _scenario(arguments: argparse.Namespace) -> Scenario:
    from ..simulation import Scenario

    return Scenario(
        arguments.wire,
        arguments.tap,
        transactions=_TRANSACTIONS if arguments.transactions is None else arguments.transactions,
        seed=arguments.seed,
        baud=arguments.baud,
        char_bits=_char_bits(arguments),
        units=arguments.units,
        defect=arguments.defect,
        maps=tuple(arguments.map),
    )


def _char_bits(arguments: argparse.Namespace) -> int:
    """Bits of a character as the options tell; 11 where none does."""
    given = (arguments.parity, arguments.bits, arguments.stop)
    if arguments.char_bits is not None:
        return int(arguments.char_bits)
    if given == (None, None, None):
        return _CHAR_BITS
    parity, bits, stop = given
    return 1 + (bits or 8) + (parity not in (None, "N")) + math.ceil(stop or 1)


def _refuse_what_is_drawn(arguments: argparse.Namespace) -> None:
    for name in ("wire", "defect", "map", "transactions", "baud", "char_bits", "units", "parity", "bits", "stop"):
        if getattr(arguments, name):
            option = name.replace("_", "-")
            raise UsageError(f"--cause makes a site of its own: leave out --{option} or --cause")
