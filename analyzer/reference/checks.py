"""The reference of the rules, as Markdown, made from the forms: `python -m analyzer.reference.checks`."""

from __future__ import annotations

from typing import Final

from ..checks.model import forms
from ..checks.rules.counts import WORDS

_HEAD: Final = """\
# Rules for `rtuscope check`

Assertions on a capture, for test benches and CI. This page is made from the table of forms
(`python -m analyzer.reference.checks`); a test holds it true.

```sh
rtuscope check bus.jsonl --rule 'no crc errors' --rule 'p95 response_time < 80 ms'
rtuscope check bus.jsonl --rules bench.toml --junit results.xml --overwrite
```

| rule | holds when | examples |
| --- | --- | --- |
"""

_TAIL: Final = """\

- A **finding's code** ([findings.md](findings.md)) stands after `no` and `at most N`. `of severity warning` means
  warnings and errors.
- **Plain words** for what is asked most, and the [display filter](filters.md) that each stands for:
{words}
- **Times** need a unit: us, ms, s, min, h. What this capture cannot tell (response times behind a slow tap, load
  without a known baud) fails its rule and says `unknown`: a bench must not pass because nothing was measured.
- **Addresses**: `40108`, `400108` and `4x108` count from 1, as everywhere. A range that begins with 0, such as
  `4x0-100`, counts from 0: addresses 0 to 100. What was taken is said in the result.
- **Filters** take all that [filters.md](filters.md) has; in `all where A: B` the colon parts the two.
- Words may be in capitals.

## A file of rules

```toml
[[rule]]
name = "wire"
check = "no crc errors"

[[rule]]
check = "at most 3 retries"
severity = "warning"
```

A broken rule of severity `warning` is told as WARN and fails nothing. `name` is what reports call the rule.

## Results

One line a rule: PASS, FAIL or WARN, what was measured, and up to five places. `--json` gives the same as JSON,
`--junit FILE` writes JUnit XML, a test case a rule; over an older file with `--overwrite`, or where you say so on a
terminal. Without rules, `no findings of severity error` is asserted.
Exit status 0 when no rule fails, 1 when one does or the capture holds no frame, 2 for arguments that cannot be used.

## In Python

```python
import captures
from analyzer.checks import compile_check, run

bus = captures.open("bus.jsonl")
results = run(bus, [compile_check("every poll answered", bus.line)])
assert results.passed, results.outcomes
```
"""


def markdown() -> str:
    """The page, newline at the end."""
    rows = "".join(
        f"| `{form.examples[0]}` | {form.help} | {', '.join(f'`{e}`' for e in form.examples[1:])} |\n"
        for form in forms()
    )
    words = "\n".join(f"  `{name.replace('-', ' ')}` (`{text}`)," for name, text in WORDS.items()).rstrip(",") + "."
    return _HEAD + rows + _TAIL.format(words=words)


if __name__ == "__main__":
    import sys

    sys.stdout.write(markdown())
