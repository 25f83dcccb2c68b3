"""The reference of the language, as Markdown, made from the table of fields: `python -m analyzer.reference.filters`."""

from __future__ import annotations

from typing import Final

from ..filters.fields import FIELDS, Cost, FilterField

_HEAD: Final = """\
# The display filter

One language for the frame list, `rtuscope export --filter`, `rtuscope report --filter` and live views. This page is
made from the table of fields (`python -m analyzer.reference.filters`); a test holds it true.

```text
unit == 17 and function in (3, 4)
exception or crc_ok == false
register == 40108 and value > 1000
response_time > 50ms or unanswered
gap > 3.5 chars and not noise
finding == "late-response"
hex contains "03 02"
value("Voltage L*") < 207 V
```

## How it reads

- A **field alone** asks whether the row has it (`exception`), or whether it is true (`noise`, `late`).
- A **comparison** is `FIELD OPERATOR VALUE`: `==` (or `=`), `!=`, `<`, `<=`, `>`, `>=`, `contains`, `matches`.
- `in` takes values and ranges: `function in (3, 4)`, `unit in 1..5`, `index in (7, 100..200)`; `not in` the opposite.
  Sets as Wireshark writes them do, too: `modbus.func_code in {3 4}`.
- `and`, `or`, `not` (`&&`, `||`, `!`) join them; `and` binds closer than `or`; parentheses as usual. Words may be in
  capitals.
- **Numbers** are decimal or hexadecimal (`0x2B`). **Times** need a unit: `us`, `ms`, `s`, `min`, `h`, or `chars`, which
  are characters at the line's speed (11 bits each unless the capture says otherwise).
- **Names** stand in quotes where they hold spaces: `function == "Read Coils"`, `severity >= warning`. Case,
  spaces, `-` and `_` do not matter: `function == read_coils`.
- **Bytes** and **texts** stand in quotes, single or double.

## What is true of what

- A row that has no such thing is never as wanted: noise has no unit, so neither `unit == 17` nor `unit != 17` is true
  of it; `not unit == 17` is.
- Where a row has several (values, addresses, findings), a comparison is true if **any** is as wanted; `!=` and `not in`
  if **none** is equal.
- Joined by `and`, tests of an address (`register`, `bit`, `address`) and of a value (`value`, `signed_value`) speak of
  **the same value**: `register == 40108 and value > 1000` is the value of that register, in a response too, whose
  addresses come from its request. Parentheses make groups:
  `(register == 40108 and value > 1000) and (register == 40109 and value == 0)`.
- With a register map (`--map MAP[@UNIT]`), `value("Active power") > 5 kW` is the mapped value of that name in the
  answer: in the unit that is written, else in the map's own. The name may hold `*` and `?`; names of states are values,
  too: `value("Mode") == "standby"`. `value("Energy")` alone asks whether the answer holds it.
- `register` takes logical numbers of 5 or 6 digits (`40108`, `400108`, `4x108`: all physical address 107) and, below
  10000, physical addresses; `address` takes physical ones only, of any area. Of function 23 the addresses read count.
- An exception has the address and the quantity of the request that it answers.

## Fields

| field | what it is | compared with | operators | example |
| --- | --- | --- | --- | --- |
"""

_TAIL: Final = """\

¹ Known only once the frames after the row have come: as rows arrive live, such a test may miss what files show.
² Looked at only where the cheaper tests of the same `and` have left rows, whatever their order.

## In commands

`export --filter` writes the frames that pass, with the same content as without a filter. Noise stretches are written
with `--noise`, or where the filter names `noise`. An MCAP file holds the whole capture and is not filtered.

`report --filter` counts what passes. A transaction counts where its request or its answer passes, whole: with
`--filter response`, requests are not called unanswered. Findings count with the row that they stand on; those about the
bus as a whole stay. Span and load are of the rows that pass.

Exit status 1 where nothing passes, 2 for a filter that cannot be used, with the column of the mistake.

## In Python

```python
import analyzer
from analyzer.filters import BatchTable, compile_filter

bus = analyzer.open("bus.jsonl")
slow = compile_filter("response_time > 50ms", bus.line)
for found in bus.analysed():
    passed = slow.mask(BatchTable(found.batch, bus.line, transactions=found.transactions))
    print(found.batch.rows.index[passed])
```
"""


def markdown() -> str:
    """The page, newline at the end."""
    return _HEAD + "".join(_field_row(field) for field in FIELDS) + _TAIL


def _field_row(field: FilterField) -> str:
    names = ", ".join(f"`{name}`" for name in (field.name, *field.aliases))
    marks = ("¹" if field.settled else "") + ("²" if field.cost >= Cost.BYTES else "")
    operators = " ".join(f"`{operator}`" for operator in field.kind.operators)
    return f"| {names}{marks} | {field.help} | {field.kind.values} | {operators} | `{field.example}` |\n"


if __name__ == "__main__":
    import sys

    sys.stdout.write(markdown())
