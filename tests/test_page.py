"""The page in the browser: built by one command, reads as `parse` does, asks nothing of anybody.

What needs Node, Chromium or npm's package pyodide skips where that is not there: `npm install pyodide` in the project's
folder, or RTUSCOPE_PYODIDE names the package's folder.
"""

from __future__ import annotations

import io
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from urllib.parse import quote

import pytest
from browser import Browser, chromium, served
from running import ROOT, ran

from analyzer.reference.page.building import PageError, archive, build
from analyzer.reference.page.reading import printed, printed_file

PYODIDE = Path(os.environ.get("RTUSCOPE_PYODIDE") or ROOT / "node_modules" / "pyodide")
OWN = ROOT / "analyzer" / "reference" / "page"
CORPUS = ROOT.parent / "shared" / "corpus"
LIMIT = 6_000_000  # bytes beyond Pyodide
_NODE = """
import { readFileSync } from "node:fs";
const { load } = await import(process.argv[2]);
const reader = await load({ indexURL: process.argv[3] });
const told = [];
for (const [language, text] of JSON.parse(readFileSync(0, "utf8"))) {
  const shown = reader.parse(text, language);
  told.push([shown, reader.complaint]);
}
console.log(JSON.stringify(told));
"""
needs_pyodide = pytest.mark.skipif(not PYODIDE.is_dir(), reason="npm's package pyodide is not here")
PASTE = "TX: 11 03 00 6B 00 03 76 87\nRX: 11 03 06 AE 41 56 52 43 40 49 AD\nRX: 11 83 02 C1 34\n"
TEXTS = [
    ("en", PASTE),
    ("ru", PASTE),
    ("en", "11 03 00 6B 00 03 76 88 FF 00 12 34"),
    ("ru", "nothing of that kind"),
    ("en", ":1103006B00037E\r\n"),
    ("en", "0x00 0x01 0x00 0x00 0x00 0x06 0x11 0x03 0x00 0x6B 0x00 0x03"),
    ("en", "09 03 00 00 00 02 C5 43 09 03 04 00 01 00"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page, with Pyodide where there is one."""
    out = tmp_path_factory.mktemp("page") / "page"
    assert build(out, PYODIDE if PYODIDE.is_dir() else None) < LIMIT
    return out


def test_one_command_builds_it(tmp_path):
    command = [sys.executable, "-m", "analyzer.reference.page", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    assert re.search(r"out: \d\.\d MB, Pyodide apart", done.stdout)
    made = {path.name for path in (tmp_path / "out").iterdir()}
    assert made == {"index.html", "page.css", "page.mjs", "worker.mjs", "rtuscope.mjs", "rtuscope.zip"}
    again = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert again.returncode == 2
    assert again.stderr.count("\n") == 1
    assert "out: file exists" in again.stderr


def test_what_is_no_pyodide_is_said(tmp_path):
    with pytest.raises(PageError, match="holds no"):
        build(tmp_path / "out", tmp_path)
    assert not (tmp_path / "out").exists()


def test_the_archive_is_the_same_each_time_and_holds_nothing_of_a_person(tmp_path):
    assert archive() == archive()
    (tmp_path / "page.zip").write_bytes(archive())
    with zipfile.ZipFile(tmp_path / "page.zip") as packed:
        names = packed.namelist()
        told = packed.read("analyzer/reference/page/reading.py")
    assert {"numpy/__init__.py", "construct/core.py", "analyzer/languages/ru.frames.toml"} <= set(names)
    assert not [name for name in names if name.startswith(("/", "..")) or "samples" in name or "__pycache__" in name]
    assert told == (OWN / "reading.py").read_bytes()


@pytest.mark.parametrize(("language", "text"), TEXTS)
def test_it_reads_as_the_command_does(language, text, capsys, tmp_path):
    (tmp_path / "paste.txt").write_bytes(text.encode())
    done = ran(capsys, "parse", "-f", tmp_path / "paste.txt", "--lang", language)
    shown = printed(text, language)
    assert shown.text == done.out
    assert shown == printed_file(text.encode(), language) == printed_file(text.encode("utf-16"), language)
    assert bool(shown.complaint) == (done.status == 2)
    assert shown.complaint in done.err


def test_each_word_of_the_page_is_there_in_both_languages():
    script = (OWN / "page.mjs").read_text(encoding="utf-8")
    english, russian = (re.findall(r"^    (\w+): \"(.*)\",$", part, re.M) for part in script.split("  ru: {"))
    assert [name for name, _ in english] == [name for name, _ in russian]
    assert all(re.search("[а-я]", words) for _, words in russian)
    assert [re.findall(r"\{\w+\}", words) for _, words in english] == [re.findall(r"\{\w+\}", w) for _, w in russian]
    markup = (OWN / "index.html").read_text(encoding="utf-8")
    assert set(re.findall(r'data-words="(\w+)"', markup)) <= {name for name, _ in english}


def test_nothing_of_the_page_is_elsewhere():
    policy = re.search('Content-Security-Policy" content="([^"]+)"', (OWN / "index.html").read_text(encoding="utf-8"))
    assert policy is not None
    told = {name: sources for name, *sources in (each.split() for each in policy[1].split("; "))}
    assert told["default-src"] == ["'none'"]
    assert {source for sources in told.values() for source in sources} <= {
        "'none'", "'self'", "data:", "'wasm-unsafe-eval'",
    }  # fmt: skip
    for name in ("index.html", "page.css", "page.mjs", "worker.mjs", "rtuscope.mjs"):
        assert "http" not in (OWN / name).read_text(encoding="utf-8").replace("http-equiv", "")


@needs_pyodide
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not here")
def test_its_python_is_compiled_by_the_one_that_runs_it(page):
    with zipfile.ZipFile(page / "rtuscope.zip") as packed, zipfile.ZipFile(io.BytesIO(archive())) as sources:
        assert set(packed.namelist()) == {re.sub(r"\.py$", ".pyc", name) for name in sources.namelist()}


@needs_pyodide
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not here")
def test_node_reads_as_the_command_does(page, tmp_path):
    files = sorted(CORPUS.glob("pastes*/*.txt")) if CORPUS.is_dir() else []
    texts = [*TEXTS, *(("en", path.read_text(encoding="utf-8", errors="replace")) for path in files)]
    (tmp_path / "read.mjs").write_text(_NODE)
    command = ["node", str(tmp_path / "read.mjs"), (page / "rtuscope.mjs").as_uri(), f"{PYODIDE}/"]
    done = subprocess.run(
        command, input=json.dumps(texts), capture_output=True, text=True, encoding="utf-8", check=True
    )
    told = json.loads(done.stdout)
    assert len(told) == len(texts)
    wrong = [text for (language, text), shown in zip(texts, told, strict=True) if [*printed(text, language)] != shown]
    assert wrong == []


@needs_pyodide
@pytest.mark.skipif(chromium() is None, reason="chromium is not here")
@pytest.mark.skipif(os.name != "posix", reason="the browser is driven over POSIX pipes")
def test_a_browser_reads_it_in_both_languages_and_asks_nobody_else(page, tmp_path):
    hostile = f"{PASTE}<img src=x onerror=alert(1)><script>document.title='taken'</script>\n"
    shown = "document.getElementById('frames').textContent"
    with served(page) as (url, heard), served(tmp_path) as (elsewhere, overheard), Browser(tmp_path / "p") as browser:
        browser.go(f"{url}#paste={quote(hostile)}")
        browser.wait_for(f"{shown.replace('.text', '?.text')}?.length > 100")
        language = browser.value("document.documentElement.lang")
        assert browser.value(shown) == printed(hostile, language).text
        for language in ("en", "ru"):
            browser.value(f"document.getElementById('{language}').click()")
            wanted = json.dumps(printed(hostile, language).text)
            browser.wait_for(f"{shown} === {wanted}")
            assert browser.value("document.documentElement.lang") == language
        assert browser.value("CSS.highlights.get('wrong').size") >= 1
        browser.picture(tmp_path / "page.png")
        assert (tmp_path / "page.png").stat().st_size > 10_000
        assert browser.value("document.title") == "rtuscope"
        assert browser.value("document.querySelectorAll('#frames *').length") == 0
        for way in (
            f"fetch('{elsewhere}a')",
            f"fetch('{elsewhere}b', {{method: 'POST', mode: 'no-cors', body: 'x'}})",
            f"new Promise((go, no) => Object.assign(new Image(), {{onload: go, onerror: no, src: '{elsewhere}c'}}))",
            f"import('{elsewhere}d.mjs')",
        ):
            assert browser.value(f"{way}.then(() => 'went', () => 'stopped')") == "stopped"
        assert browser.value(f"navigator.sendBeacon('{elsewhere}e', 'x'), 1") == 1
        browser.value("document.getElementById('clear').click()")
        browser.wait_for(f"{shown} === ''")
    assert overheard == []
    assert len(heard) >= 8
    assert {path for path in heard if not path.startswith(("/pyodide/", "/page.", "/worker.", "/rtuscope."))} == {"/"}
    assert not [asked for asked in browser.asked if not asked.startswith((url, elsewhere, "data:"))]
