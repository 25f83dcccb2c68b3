"""The pages themselves, and where they go: `fleet.html`, and a page a site in `fleet.sites` beside it.

The templates `fleet.html.j2` and `site.html.j2` only lay out; their values are made here. All pages are written under
names of their own and put in their places at the end, so that whoever opens them sees the old pages or the new ones.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Final
from unicodedata import normalize
from urllib.parse import quote

from captures.disposal import TemporaryFolder, move_folder, remove_empty_folder, remove_proven
from captures.errors import CaptureError, os_reason
from captures.files import replacing

from ...languages import counted, page_words
from ...reports.html.page import about, page_environment
from .. import FleetError
from ..lake import Lake
from .sites import CURVE, CauseSpell, SiteHealth, calendar_ends, level_words, sites_of, spelled
from .sums import NO_CLOCK, FleetSpan

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
    fleet = FleetSpan(lake)
    days, sites = fleet.calendar, list[SiteHealth]()
    environment.globals["undated"] = len(days) > 1 and days[0] < NO_CLOCK  # the first column is of no date
    first, last = calendar_ends(days)
    template = environment.get_template("site.html.j2")
    for site in sites_of(lake, named, fleet):
        yield site.file, template.render(site=site, home=f"../{quote(page)}", first=first, last=last)
        sites.append(replace(site, units=(), damaged=(), latest=()))
    sites.sort(key=lambda one: (-(one.sums.bad_percent or 0), one.name))
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
            "; {bad:.3g}% of {asked:,} requests without a good answer", bad=100 * bad / asked, asked=asked
        )
    if ill:
        told = counted(ill, "recorded site", "recorded sites")
        words += page_words("; errors at {sites} in the last two days", sites=told)
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


_PLAIN: Final = re.compile(r"[^\w.-]+")
_LONGEST: Final = 48  # characters of a site's name in that of its page
_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?")  # what Windows takes for something else
_ENDING: Final = ".html"
_PAGES: Final = (_ENDING, ".htm")


def site_folder(page: str | Path) -> Path:
    """The folder of the sites' pages, beside that of the fleet: `fleet.sites` of `fleet.html`."""
    page = Path(page)
    return page.with_name(f"{page.stem if page.suffix.lower() in _PAGES else page.name}.sites")


def page_names(sites: Iterable[str]) -> dict[str, str]:
    """The file of each site's page: its name where any file system has that, else something like it that no other has.

    The same site has the same name whenever pages are made, but where another is told from it by its case alone.
    """
    sites = list(sites)
    alike = Counter(map(_folded, sites))
    return {site: _page_name(site, alone=alike[_folded(site)] == 1) for site in sites}


def _page_name(site: str, *, alone: bool) -> str:
    plain = _PLAIN.sub("-", normalize("NFC", site)).strip(".-")[:_LONGEST]
    if plain and plain == site and alone and not _DEVICES.fullmatch(plain.lower()):
        return plain + _ENDING
    return f"{plain or 'site'}-{sha256(site.encode('utf-8', 'surrogatepass')).hexdigest()[:8]}{_ENDING}"


def _folded(site: str) -> str:
    return normalize("NFC", site).casefold()


def write_pages(lake: Lake, page: str | Path) -> int:
    """Write the fleet's page and those of its sites, all or none; how many sites there are.

    What stands there is replaced. Raises FleetError where the lake cannot be asked, where they cannot be written, or
    where the folder of the sites' pages holds anything else.
    """
    page = Path(page).resolve()
    folder = site_folder(page)
    if page.is_dir():
        raise FleetError(f"{page}: is a folder: give the name of a file to write")
    foreign = foreign_file(folder)
    if foreign is not None:
        raise _foreign(foreign, folder)
    named = page_names(lake.sites)
    try:
        with TemporaryFolder(f".{folder.name}.", page.parent) as scratch:
            new = scratch / "new"
            new.mkdir()
            with replacing(page) as stream:
                for name, text in rendered(lake, page.name, folder.name, named):
                    if name is None:
                        stream.write(text.encode())
                    else:
                        with (new / name).open("xb") as file:
                            file.write(_signed(name, text.encode()))
                _settle(new, folder, scratch.with_name(f"{scratch.name}.old"))
    except FileNotFoundError as error:
        raise FleetError(f"{page}: cannot be written: no folder {page.parent}") from error
    except CaptureError as error:
        raise FleetError(str(error)) from error
    except OSError as error:
        raise FleetError(f"{page}: cannot be written: {os_reason(error)}") from error
    return len(named)


def _settle(new: Path, folder: Path, old: Path) -> None:
    """The new folder in its place; if that cannot be, the old one again. Of the old one only its pages go."""
    there = folder.exists()
    if there:
        move_folder(folder, old)
    try:
        if there and (foreign := foreign_file(old)) is not None:  # it came meanwhile
            raise _foreign(folder / foreign.name, folder)
        move_folder(new, folder)
    except BaseException:
        if there:
            move_folder(old, folder)
        raise
    if there:
        for page in old.iterdir():
            remove_proven(page, partial(_is_signed, page.name))
        remove_empty_folder(old)


_SIGNED: Final = b"<!-- rtuscope page %s -->\n"
_SIGNATURE: Final = len(_SIGNED) - 2 + 64


def _signed(name: str, text: bytes) -> bytes:
    """A page that can be told from what anybody else put there, or changed."""
    return text + _SIGNED % sha256(name.encode() + b"\0" + text).hexdigest().encode()


def _is_signed(name: str, page: bytes) -> bool:
    return page == _signed(name, page[:-_SIGNATURE])


def _foreign(path: Path, folder: Path) -> FleetError:
    return FleetError(f"{path}: is not a page of a site: empty {folder.name}, or give another name")


def foreign_file(folder: Path) -> Path | None:
    """What stands in the way of sites' pages: something in their folder, or under its name, that is none of them."""
    if folder.is_dir() and not folder.is_symlink():
        return next((each for each in sorted(folder.iterdir()) if not _is_page(each)), None)
    return folder if folder.exists() or folder.is_symlink() else None


def _is_page(path: Path) -> bool:
    return path.is_file() and not path.is_symlink() and _is_signed(path.name, path.read_bytes())
