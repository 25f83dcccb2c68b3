"""Bytes written one a line, or a field a line, that no check value speaks for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Final

from .choosing import Experience
from .columns import FEW, FIELDS, LEAST_COLUMN, bytes_of_columns, holds_bytes, is_right, take_tokens
from .loglines import LogLine
from .tokens import JOINED, NumberToken, skeleton_of, tokens_of
from .tools import names_a_way

_SAID_BEFORE: Final = re.compile(r"(?<![\w.])(?:0b(?P<bits>[01]{8})|(?P<decimal>\d{1,3}))\W{1,3}$")


def settle_unchecked(lines: Sequence[LogLine], experience: Experience) -> None:
    """A byte or a field a line without a check value behind them.

    Lines of nothing but one or two hex digits; and, where a text holds nothing that is plainer, bytes beside what each
    means: `0x01 -> unit`. Numbers that only rise or fall count something, and are none.
    """
    for twice, same in groupby(lines, _in_two_bases):
        group = list(same)
        if not twice or len(group) < LEAST_COLUMN or any(map(holds_bytes, group)) or bytes_of_columns(group):
            continue
        for line in group:
            token = tokens_of(line)[-1]
            take_tokens(line, [token], token.hexadecimal or b"", checked=False)
            line.continues = line is not group[0] and line.t_ns == group[0].t_ns
    for _, same in groupby(lines, lambda line: bool(tokens_of(line)) and not is_right(line) and not holds_bytes(line)):
        group = list(same)
        table = [tokens_of(line, JOINED) for line in group]
        if len(group) < LEAST_COLUMN or not all(table):
            continue
        bare = all(tokens[0].digits == line.clean.strip() for line, tokens in zip(group, table, strict=True))
        named = _are_numbered(table) or len({skeleton_of(line) for line in group}) >= FIELDS
        if not bare and not (experience.meanings and named):
            continue
        for i in (0, -1):
            column = [tokens[i] for tokens in table]
            parts = [token.hexadecimal for token in column]
            if None not in parts and _are_written_as_bytes(column, bare=bare) and not _counts_on(parts):
                for line, token, part in zip(group, column, parts, strict=True):
                    take_tokens(line, [token], part or b"", checked=False)
                    line.continues = line is not group[0] and line.t_ns == group[0].t_ns
                break


def _in_two_bases(line: LogLine) -> bool:
    """`received Byte 27 (0X1b)`: a byte of a message in decimal, or bit by bit, and in hex."""
    tokens = tokens_of(line)
    if not tokens:
        return False
    token = tokens[-1]
    said = _SAID_BEFORE.search(line.clean[: token.start])
    if said is None or not token.signed or len(token.digits) > 2 or not names_a_way(skeleton_of(line)):
        return False
    return int(token.digits, 16) == (int(said["bits"], 2) if said["bits"] else int(said["decimal"]))


def _are_numbered(table: Sequence[Sequence[NumberToken]]) -> bool:
    """Whether lines begin with their numbers, from 0 or 1 on."""
    numbers = [tokens[0].digits for tokens in table if len(tokens) > 1]
    return any(numbers == [*map(str, range(first, first + len(table)))] for first in (0, 1))


def _are_written_as_bytes(column: Sequence[NumberToken], *, bare: bool) -> bool:
    if any(token.is_name or len(token.digits) > 2 * FEW for token in column):
        return False
    if bare:
        return all(len(token.digits) < 3 for token in column) and any(_plainly_hex(token) for token in column)
    if all(token.signed for token in column):
        return True
    wide = all(len(token.digits) % 2 == 0 and not token.signed for token in column)
    return wide and 2 * sum(_plainly_hex(token) for token in column) >= len(column)


def _plainly_hex(token: NumberToken) -> bool:
    return len(token.digits) > 1 and (token.digits[0] == "0" or not token.digits.isdigit())


def _counts_on(parts: Sequence[bytes | None]) -> bool:
    values = [int.from_bytes(part or b"", "big") for part in parts]
    steps = [later - earlier for earlier, later in pairwise(values)]
    return min(steps) >= 0 or max(steps) <= 0
