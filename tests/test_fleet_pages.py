"""The pages of a fleet: one of all sites, one a site; whatever sites are called, in both languages, all or none."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

import captures
from analyzer import languages
from analyzer.causes.registry import numbers_kept, suspects, told_again
from analyzer.cli import main

pytest.importorskip("duckdb", reason="a lake is asked by DuckDB")
pytest.importorskip("fsspec", reason="a lake needs fsspec for object stores")

from lakes import BEGIN_NS, DAY_NS, batch, bus, write_fleet

from analyzer.fleet import FleetError, questions
from analyzer.fleet.lake import Lake
from analyzer.fleet.pages import files, site_folder, sums, write_pages
from analyzer.fleet.pages.files import page_names
from analyzer.fleet.pages.sites import sites_of
from analyzer.fleet.pages.sums import FleetSpan

HOSTILE = "<script>alert(1)</script>"
UP = "../../up & away"
SITES = ("site0", "site1", "site2", HOSTILE, UP, "Насосная", "untimed")


@pytest.fixture(autouse=True)
def _english():
    yield
    languages.use_language("en")


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """Three sites of two lines over days, and some of odd names; captures that are damaged, copied, without a clock."""
    folder = tmp_path_factory.mktemp("pages")
    write_fleet(folder / "source", transactions=60)
    harmed = folder / "source" / "site1" / "bus1.mcap"
    harmed.write_bytes(harmed.read_bytes()[:-2000])
    (folder / "source" / "site1" / "none.pcap").write_bytes(b"")
    batch(folder / "lake", folder / "source")
    for number, site in enumerate((HOSTILE, UP, "Насосная")):
        path = folder / f"bus{number}.mcap"
        captures.write(path, bus("brutal", number, 300, begin_ns=BEGIN_NS + 20 * DAY_NS * number, span_ns=2 * DAY_NS))
        batch(folder / "lake", path, site=site)
    plain = folder / "plain.jsonl"
    captures.write(plain, bus("noisy", 7, begin_ns=0))
    batch(folder / "lake", plain, site="untimed")
    return Lake(str(folder / "lake"))


@pytest.fixture
def pages(lake, tmp_path):
    """The pages in English: the text of the fleet's, and of each site's by its name."""
    return written(lake, tmp_path / "fleet.html")


def written(lake, page):
    write_pages(lake, page)
    named = page_names(lake.sites)
    assert sorted(path.name for path in site_folder(page).iterdir()) == sorted(named.values())
    folder = site_folder(page)
    return page.read_text("utf-8"), {site: (folder / name).read_text("utf-8") for site, name in named.items()}


class Page(HTMLParser):
    """Elements of a page: links, headings and all text; whether each element is closed."""

    def __init__(self, text):
        super().__init__()
        self.links, self.words, self.tags, self.ids = [], [], [], set()
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.tags.append((tag, attrs))
        self.ids.add(attrs.get("id"))
        if tag == "a":
            self.links.append(attrs["href"])
        if tag not in ("meta", "br", "link", "polyline"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def test_the_fleet_leads_to_each_site_and_back(lake, tmp_path):
    page = tmp_path / "fleet of 100%.html"
    fleet, sites = written(lake, page)
    assert len(sites) == len(SITES)
    links = set(Page(fleet).links)
    assert {(page.parent / unquote(link)).resolve() for link in links} == set(site_folder(page).resolve().iterdir())
    for site, text in sites.items():
        told = Page(text)
        homes = {link for link in told.links if not link.startswith("#")}
        assert {(site_folder(page) / unquote(link)).resolve() for link in homes} == {page.resolve()}
        assert {link[1:] for link in told.links if link.startswith("#")} <= told.ids
        assert ("h1", {}) in told.tags and site in told.text


def test_pages_fetch_and_run_nothing(pages):
    fleet, sites = pages
    for text in (fleet, *sites.values()):
        assert HOSTILE not in text and "url(" not in text and "@import" not in text
        for tag, attrs in Page(text).tags:
            assert tag not in ("script", "link", "img", "iframe", "object", "base")
            assert "src" not in attrs and not any(name.startswith("on") for name in attrs)
            assert not re.match(r"\w+:|//", attrs.get("href", ""))


def days_and_sites(lake):
    span = FleetSpan(lake)
    return span.calendar, list(sites_of(lake, page_names(lake.sites), span))


def test_some_sites_at_a_time_make_the_same_pages(lake, pages, tmp_path, monkeypatch):
    monkeypatch.setattr(questions, "HOURS_AT_ONCE", 1)
    assert len(questions.sites_at_once(lake)) == len(lake.sites) > 4
    assert written(lake, tmp_path / "fleet.html") == pages


def test_a_site_tells_its_causes_units_and_captures(lake, pages):
    fleet, sites = pages
    days, told = days_and_sites(lake)
    assert [cell.level for cell in told[0].strip.cells].count("none") < len(days)
    wanted = lake.arrow("SELECT DISTINCT site, cause, text, remedy FROM causes ORDER BY ALL").to_pylist()
    assert {row["site"] for row in wanted} >= {HOSTILE, "Насосная"}
    for row in wanted:
        told_there = Page(sites[row["site"]]).text
        assert row["cause"] in told_there and row["remedy"] in told_there
    newest = lake.arrow("SELECT site, arg_max(text, t_ns) AS text FROM causes GROUP BY site, line, cause, units")
    assert all(row["text"] in Page(sites[row["site"]]).text for row in newest.to_pylist())
    rows = lake.arrow("SELECT site, unit, sum(requests) AS n FROM hours WHERE unit > 0 GROUP BY ALL").to_pylist()
    assert all(f"{int(row['n']):,}" in Page(sites[row["site"]]).text for row in rows if row["site"] == HOSTILE)
    harmed = Page(sites["site1"]).text
    assert "damaged in part" in harmed and "not readable" in harmed and "the file is empty" in harmed
    assert 'id="damaged"' not in sites["site0"]
    assert "no clock" in Page(sites["untimed"]).text and "1970" not in sites["untimed"] + fleet
    assert str(lake.store.root) not in "".join((fleet, *sites.values()))  # no folders of this machine


def test_figures_are_those_of_the_lake(lake, pages):
    fleet, _ = pages
    (row,) = lake.arrow(
        "SELECT sum(requests - broadcast - unheard) AS asked, sum(exception + unanswered + damaged) AS bad FROM hours"
    ).to_pylist()
    said = f"{100 * float(row['bad']) / int(row['asked']):.3g}% of {int(row['asked']):,} requests without a good answer"
    assert f"{len(SITES)} sites; {said}" in Page(fleet).text


def test_days_without_a_capture_stand_as_gaps(lake):
    days, sites = days_and_sites(lake)
    assert days[0] == 0  # what has no clock
    assert days[1:] == list(range(days[1], days[-1] + 1)) and 40 < len(days) <= sums.DAYS + 1
    late = next(site for site in sites if site.name == "Насосная")
    assert [cell.level for cell in late.strip.cells[:30]] == ["none"] * 30
    assert late.strip.cells[-1].level != "none" and not late.behind
    assert next(site for site in sites if site.name == "site0").behind


def test_what_is_new_is_told_and_of_a_young_lake_nothing_is(pages, tmp_path):
    assert "New in the last 7 days" in pages[0]
    assert "Насосная" in pages[0].partition("New in the last 7 days")[2]
    captures.write(tmp_path / "bus.mcap", bus("brutal", 3, 300))
    batch(tmp_path / "young", tmp_path / "bus.mcap")
    fleet, _ = written(Lake(str(tmp_path / "young")), tmp_path / "young.html")
    assert "interference" in fleet and "New in" not in fleet


def test_pages_in_russian_say_the_same(lake, tmp_path, pages):
    assert main(["report", lake.store.root, "--html", str(tmp_path / "ru.html"), "--lang", "ru"]) == 0
    fleet = (tmp_path / "ru.html").read_text("utf-8")
    sites = [path.read_text("utf-8") for path in sorted(site_folder(tmp_path / "ru.html").iterdir())]
    for text in (fleet, *sites):
        assert '<html lang="ru">' in text and "все объекты" in text.lower()
        words = re.sub(re.escape(HOSTILE) + "|" + re.escape(UP), "", Page(text).text)
        known = languages.catalogue("ru")["page"]
        left = [english for english in known if " " in english and len(english) > 8 and english in words]
        assert not left
    assert '<html lang="en">' in pages[0]
    causes = {row["cause"] for row in lake.arrow("SELECT DISTINCT cause FROM causes").to_pylist()}
    assert causes
    for suspect in suspects():
        if suspect.cause in causes:
            told = languages.cause_words(suspect.cause, "remedy", suspect.remedy)
            assert told != suspect.remedy and any(told in Page(text).text for text in sites)


def test_a_cause_that_cannot_be_retold_is_told_as_it_was_kept():
    suspect = next(each for each in suspects() if "{" in each.text)
    languages.use_language("ru")
    assert told_again("no-such-cause", "{}") is None
    assert (
        told_again(suspect.cause, None)
        is told_again(suspect.cause, "no JSON")
        is told_again(suspect.cause, "{}")
        is None
    )
    assert told_again(suspect.cause, "[1]") is None


def test_causes_are_told_again_from_their_numbers(lake):
    rows = lake.arrow("SELECT cause, text, share, deciding_test, remedy, numbers FROM causes").to_pylist()
    assert rows
    for row in rows:
        words = told_again(row["cause"], row["numbers"])
        assert words is not None
        assert (words.text, words.share, words.deciding_test, words.remedy) == tuple(
            row[name] for name in ("text", "share", "deciding_test", "remedy")
        )


def test_rows_of_a_lake_are_english_whatever_is_spoken(tmp_path):
    captures.write(tmp_path / "bus.mcap", bus("brutal", 3, 300))
    for language in languages.LANGUAGES:
        languages.use_language(language)
        batch(tmp_path / language, tmp_path / "bus.mcap")
    one, two = (Lake(str(tmp_path / language)) for language in languages.LANGUAGES)
    for table in ("causes", "findings"):
        text = f"SELECT {table}::VARCHAR FROM {table} ORDER BY ALL"
        assert one.sql(text).fetchall() == two.sql(text).fetchall() != [], table


@pytest.mark.parametrize(
    "site",
    [
        "plant-3",
        "Насосная",
        "",
        ".",
        "..",
        "CON",
        "nul.x",
        "a/b",
        "a\\b",
        "a b",
        "x" * 300,
        "ж" * 300,
        "a\0b",
        "🏭",
        "-",
        "a.",
    ],
)
def test_any_site_has_a_file(site, tmp_path):
    (name,) = page_names([site]).values()
    assert page_names([site, "other"])[site] == name  # whatever else there is
    assert len(name.encode()) < 200 and not re.search(r'[\\/:*?"<>|\0\s%#]', name)
    assert name.lower() not in ("con.html", "nul.x.html") and not name.startswith(".")
    (tmp_path / name).write_text("")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_no_two_sites_share_a_file():
    sites = [
        "plant",
        "Plant",
        "PLANT",
        "plant ",
        "plant-",
        "plant/",
        "Straße",
        "strasse",
        "é",
        "e\u0301",
        "a b",
        "a-b",
        "",
        "site",
    ]
    names = page_names(sites)
    assert len({name.casefold() for name in names.values()}) == len(sites)
    assert page_names(["plant"])["plant"] == "plant.html"


def test_written_again_pages_are_those_of_the_lake_now(lake, tmp_path):
    page = tmp_path / "fleet.html"
    write_pages(lake, page)
    folder = site_folder(page)
    (folder / "gone.html").write_bytes(files._signed("gone.html", b"a site that is no more"))
    (folder / "site0.html").write_bytes(files._signed("site0.html", b"old"))
    write_pages(lake, page)
    assert not (folder / "gone.html").exists() and (folder / "site0.html").read_bytes()[:3] != b"old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fleet.html", "fleet.sites"]


@pytest.mark.parametrize("moment", ["rendering", "writing", "settling"])
def test_what_goes_wrong_leaves_the_old_pages(lake, tmp_path, monkeypatch, moment):
    page = tmp_path / "fleet.html"
    write_pages(lake, page)
    folder = site_folder(page)
    old = files._signed("site0.html", b"old")
    (folder / "site0.html").write_bytes(old)
    page.write_text("old")

    def failing(*_):
        raise OSError(28, "No space left on device")

    if moment == "rendering":
        whole = files.rendered
        monkeypatch.setattr(
            files, "rendered", lambda *a: (failing() if n == 3 else each for n, each in enumerate(whole(*a)))
        )
    elif moment == "writing":
        monkeypatch.setattr(files, "_signed", failing)
        monkeypatch.setattr(files, "_is_page", lambda _: True)
    else:
        rename = Path.rename
        monkeypatch.setattr(Path, "rename", lambda own, to: failing() if own.name == "new" else rename(own, to))
    with pytest.raises(FleetError, match="no space left"):
        write_pages(lake, page)
    assert page.read_text() == "old" and (folder / "site0.html").read_bytes() == old
    assert len(list(folder.iterdir())) == len(SITES)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fleet.html", "fleet.sites"]


def test_nobodys_files_are_taken_away(lake, tmp_path, capsys):
    page = tmp_path / "fleet.html"
    mine = tmp_path / "fleet.sites" / "notes.txt"
    mine.parent.mkdir()
    mine.write_text("mine")
    command = ["report", lake.store.root, "--html", str(page)]
    assert main(command) == 2 and "--overwrite" in capsys.readouterr().err
    assert main([*command, "--overwrite"]) == 2
    assert "notes.txt" in capsys.readouterr().err and mine.read_text() == "mine" and not page.exists()
    mine.unlink()
    assert main([*command, "--overwrite"]) == 0
    assert main(command) == 2 and "--overwrite" in capsys.readouterr().err
    changed = tmp_path / "fleet.sites" / "site0.html"
    changed.write_text(changed.read_text("utf-8") + "what I found at the cabinet")
    kept = changed.read_bytes()
    assert main([*command, "--overwrite"]) == 2 and "site0.html" in capsys.readouterr().err
    assert changed.read_bytes() == kept
    changed.unlink()
    outside = tmp_path / "outside.html"
    outside.write_text("mine")
    changed.symlink_to(outside)
    assert main([*command, "--overwrite"]) == 2 and outside.read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["--json"],
        ["--html", "-"],
        ["--html", "nowhere/fleet.html"],
        ["--html", "fleet.html", "--filter", "unit == 3"],
        ["--html", "fleet.html", "--by", "hour"],
        ["--html", "fleet.html", "--values"],
    ],
)
def test_what_no_fleet_can_be_told_by_is_refused(lake, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["report", lake.store.root, *words]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1 and "defect" not in error
    assert not list(tmp_path.iterdir())


def test_a_site_of_many_units_and_captures_says_what_it_leaves_out(lake, tmp_path, monkeypatch):
    for name, least in (("_UNITS", 2), ("_LATEST", 1), ("_HARMED", 1), ("_SITE_CAUSES", 1)):
        text = getattr(sums, name)
        monkeypatch.setattr(sums, name, re.sub(r"<= \d+", f"<= {least}", text))
    _, sites = written(lake, tmp_path / "fleet.html")
    assert re.search(r"and \d+ units that answered better", Page(sites["site1"]).text)
    assert "and 2 older ones" in Page(sites["site1"]).text
    assert "and 1 more: rtuscope ask LAKE damaged" in Page(sites["site1"]).text


def test_numbers_of_numpy_are_kept_as_numbers():
    kept = numbers_kept({"n": np.int64(3), "x": np.float64(0.5), "word": "да"})
    assert json.loads(kept) == {"n": 3, "x": 0.5, "word": "да"}
