"""The pages themselves: values for the templates `fleet.html.j2` and `site.html.j2`, which only lay out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Final
from urllib.parse import quote

from ...languages import counted, page_words
from ...reports.html.causecards import about
from ...reports.html.environment import page_environment
from ..lake import Lake
from .model import CauseSpell, SiteHealth
from .sites import CURVE, calendar_ends, level_words, sites_of, spelled
from .sums import NO_CLOCK

_FRESH: Final = 12  # new causes told on the page of the fleet


def rendered(lake: Lake, page: str, folder: str, named: Mapping[str, str]) -> Iterator[tuple[str | None, str]]:
    """The page of each site by the name of its file, then that of the fleet, whose name is None.

    `page`: the name of the fleet's page; `folder`: that of the folder beside it in which sites' pages are, `named` by
    site. Raises FleetError where the lake cannot be asked.
    """
    environment = page_environment(__package__)
    environment.globals.update(
        lake=PurePosixPath(lake.store.root).name or lake.store.root,
        levels=level_words(),
        spelled=spelled,
        curve=CURVE,
        about=lambda cause: list(about(cause)),
        octets=lambda count: counted(count, "byte", "bytes"),
        state=_state,
    )
    days, sites = sites_of(lake, named)
    environment.globals["undated"] = len(days) > 1 and days[0] < NO_CLOCK  # the first column is of no date
    first, last = calendar_ends(days)
    template = environment.get_template("site.html.j2")
    for site in sites:
        yield site.file, template.render(site=site, home=f"../{quote(page)}", first=first, last=last)
    yield (
        None,
        environment.get_template("fleet.html.j2").render(
            sites=sites,
            fresh=_fresh(sites),
            href=lambda site: f"{quote(folder)}/{quote(site.file)}",
            first=first,
            last=last,
            verdict=_verdict(sites),
        ),
    )


def _fresh(sites: list[SiteHealth]) -> list[tuple[SiteHealth, CauseSpell]]:
    """The causes that first came in the last week, the heaviest first."""
    fresh = [(site, spell) for site in sites for spell in site.causes if spell.fresh]
    return sorted(fresh, key=lambda each: (-each[1].cause.bits, each[0].name, each[1].line))[:_FRESH]


def _verdict(sites: list[SiteHealth]) -> str:
    """The fleet in a sentence."""
    asked = sum(site.sums.asked for site in sites)
    ill = sum(any(spell.lately and spell.cause.severity == "error" for spell in site.causes) for site in sites)
    words = counted(len(sites), "site", "sites")
    if asked:
        bad = sum(site.sums.exceptions + site.sums.unanswered + site.sums.damaged for site in sites)
        words += page_words(
            "; {bad:.3g} % of {asked:,} requests without a good answer", bad=100 * bad / asked, asked=asked
        )
    if ill:
        told = counted(ill, "recorded site", "recorded sites")
        words += page_words("; errors in the last two days of {sites}", sites=told)
    return f"{words}."


def _state(state: str) -> str:
    """What became of a capture, in a word."""
    words = {
        "whole": page_words("whole"),
        "damaged": page_words("damaged in part"),
        "unreadable": page_words("not readable"),
        "twice": page_words("a copy"),
    }
    return words.get(state, state)
