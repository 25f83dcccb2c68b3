"""What is to be reached, as ratios within one run, and whether it was."""

from __future__ import annotations

from dataclasses import dataclass

from measuring import Result, Used
from own import COLUMNS, FINDINGS, PAIRS, Grown

BARE = 90 / 8  # `rtuscope parse`, cold: under 90 ms where bare Python takes 8 ms
_FLAT = 16  # MiB that a tenfold capture may add


@dataclass(frozen=True, slots=True)
class Goal:
    """`reached` is None where something that it needs was not measured."""

    what: str
    wanted: str
    found: str
    reached: bool | None


def goals(results: list[Result], hard: dict[str, float], starts: tuple[Used, Used], grown: list[Grown]) -> list[Goal]:
    """All of them, measured or not."""
    rates = {(r.job.section, r.job.tool): r.per_million for r in results if r.rounds and r.frames > r.few}

    def less(what: str, own: tuple[str, str], peer: tuple[str, str], times: float) -> Goal:
        wanted = f"{times:g} times less CPU than `{peer[1]}`"
        if own not in rates or peer not in rates:
            return Goal(what, wanted, "not measured", None)
        ratio = rates[peer] / rates[own]
        return Goal(what, wanted, f"{ratio:.1f} times", ratio >= times)

    fields = ("columns", "tshark -T fields")
    found = [
        less("frames, direction, pairs, values", ("columns", COLUMNS), ("columns", "tshark -V"), 15),
        less("to MCAP", ("mcap", "rtuscope"), fields, 8),
        less("to Parquet", ("parquet", "rtuscope"), fields, 8),
        less("annotated JSON lines", ("jsonl", "rtuscope"), ("jsonl", "tshark -T json"), 8),
    ]
    with_findings, without = rates.get(("findings", FINDINGS)), rates.get(("findings", PAIRS))
    share = None if with_findings is None or without is None else with_findings / without - 1
    found.append(
        Goal("findings", "under 50% on top", "not measured", None)
        if share is None
        else Goal("findings", "under 50% on top", f"{share:.0%}", share < 0.5)
    )
    if hard:
        worst = max(hard, key=lambda name: hard[name])
        ratio = hard[worst] / hard["clean bus"]
        found.append(Goal("an adversarial byte", "at most 4 clean ones", f"{ratio:.1f} times: {worst}", ratio <= 4))
    bare, parse = (used.wall for used in starts)
    if not bare:  # of some sections alone
        return found + _growing(grown)
    told = f"{parse / bare:.1f} times: {1000 * parse:.0f} ms, Python {1000 * bare:.0f} ms"
    found.append(Goal("`rtuscope parse`, cold", f"under {BARE:.1f} times bare Python", told, parse < BARE * bare))
    return found + _growing(grown)


def _growing(grown: list[Grown]) -> list[Goal]:
    found = []
    for tool in dict.fromkeys(one.tool for one in grown):
        line = [one for one in grown if one.tool == tool]
        if len(line) < 2:
            continue
        first, last = line[0], line[-1]
        ratio, added = last.per_million / first.per_million, last.peak - line[-2].peak
        to = f"{tool}, {first.frames:,} to {last.frames:,} frames"
        found.append(Goal(to, "as much time a frame (within 20%)", f"{ratio:.2f} times", ratio <= 1.2))
        if tool == "columns":
            found.append(Goal(to, "peak under 100 MiB", f"{last.peak:.0f} MiB", last.peak < 100))
        else:
            told = f"{added:+.0f} MiB over a tenth, {last.peak:.0f} in all"
            found.append(Goal(to, f"flat memory (within {_FLAT} MiB)", told, added <= _FLAT))
    return found
