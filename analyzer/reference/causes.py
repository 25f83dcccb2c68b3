"""The reference of the causes, as Markdown, made from the declarations: `python -m analyzer.reference.causes`."""

from __future__ import annotations

import re
from typing import Final

from ..causes.certainty import calibration, told_on
from ..causes.registry import Suspect, suspects
from ..languages import CLAUSE

_HEAD: Final = """\
# Causes

What `rtuscope report` says is wrong before it lists any finding: one sentence for each cause, whose fault it is, how
sure, how to be certain, what to do. This page is made from the declarations of the suspects
(`python -m analyzer.reference.causes`); a test holds it true.

A cause explains findings, and each finding is explained once: by the cause for which the evidence of the whole capture
is strongest. It is weighed in bits against a healthy bus; below a limit no cause is named, and a healthy
bus has no cause. In Python `Analysis.causes()`, in `report --json` the key `causes`. Words in ⟨brackets⟩ stand for
what was counted.

## How sure

Certainty is *certain* from 0.95 on, where a report gives the figure, *most likely* from 0.7 on, *perhaps* below. It is
fitted on simulated buses, of which each fifth of the causes was hidden in turn, and on faults for which this page has
no name. It depends on how closely the exchanges match those of the cause elsewhere, and how much closer than those of
other causes and of faults without a name; on the next best cause; and on how many exchanges no cause explains. One
claim in three is taken to be about a fault without a name: that is an assumption, and where such faults are rarer, more
is so than is stated. Results of {day} on buses, and on faults without a name, that nothing was fitted to, weighed by
that share:

{calibration}
Exchanges that went wrong and that no cause takes are listed as *not explained* (`not_explained` in JSON: unit,
exchanges, what they are like), never left out. What may well be meant is a note: a unit that slept once, a plant
that was switched off once, addresses that somebody looks for.

## Causes

| cause | severity | fault of |
| --- | --- | --- |
"""
_BLAMED: Final = {"unit": "a unit", "master": "the client", "line": "the line", "tap": "the tap", "nobody": "nobody"}
_BLANK: Final = re.compile(r"\{([a-z_]+)(?::([^}]*))?\}")
_LISTS: Final = ("units", "sisters")  # behind their noun


def markdown() -> str:
    """The page, newline at the end."""
    rows = (
        f"| [`{one.cause}`](#{one.cause}) | {one.severity.name.lower()} | {_BLAMED[one.blame]} |\n"
        for one in suspects()
    )
    head = _HEAD.replace("{calibration}", _calibration()).replace("{day}", told_on())
    return head + "".join(rows) + "".join(map(_section, suspects()))


def _calibration() -> str:
    """A table of claims, by how sure they were."""
    rows = "".join(
        f"| {low:.2f} to {high:.2f} | {claims} | {said:.2f} | {so:.2f} |\n"
        for low, high, claims, said, so in calibration()
    )
    return "| certainty | claims | mean stated | true |\n| --- | ---: | ---: | ---: |\n" + rows


def _section(one: Suspect) -> str:
    lines = (("Said", one.text), ("Seen", one.share), ("To confirm", one.deciding_test), ("Do", one.remedy))
    told = "".join(f"- **{name}:** {_plain(text)}.\n" for name, text in lines if text)
    return f"\n## {one.cause}\n\n{told}"


def _plain(text: str) -> str:
    return _BLANK.sub(_blank, CLAUSE.sub(r"\1", text)).rstrip(".")


def _blank(match: re.Match[str]) -> str:
    """What stands for a number, with the noun or the verb of several."""
    name, (noun, *forms) = f"⟨{match[1].replace('_', ' ').strip()}⟩", (match[2] or "").split("|")
    if not forms:
        return name
    if not noun:
        return forms[-1]
    return f"{forms[-1]} {name}" if match[1] in _LISTS else f"{name} {forms[-1]}"


if __name__ == "__main__":
    import sys

    sys.stdout.write(markdown())
