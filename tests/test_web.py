"""`open --web`: for whoever was given its address, and nobody else; and nothing that it does writes a file here."""

from __future__ import annotations

import asyncio
import codecs
import csv
import io
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from running import PATIENCE_S, environment, refused
from terminals import posix

from analyzer.cli.open import shell_command
from analyzer.webguard import refusal
from captures import samples

pytest.importorskip("textual_serve")
aiohttp = pytest.importorskip("aiohttp")


@contextmanager
def served(folder: Path, *arguments: str) -> Iterator[str]:
    """The interface in a browser's reach, started in a folder; its address."""
    command = [sys.executable, "-P", "-m", "analyzer.cli", "open", "--web", "--port", "0", *arguments]
    server = subprocess.Popen(
        command, env=environment(), cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    try:
        assert server.stdout is not None
        yield server.stdout.readline().strip()
    finally:
        server.send_signal(signal.SIGINT)
        assert server.wait(PATIENCE_S) == 0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("web")
    shutil.copy(samples.path("troubled.jsonl"), folder / "it's 100% a & b.jsonl")
    return folder


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    if os.name != "posix":
        pytest.skip("signals are POSIX")
    with served(folder, "it's 100% a & b.jsonl") as address:
        yield address


class Browser:
    """A tab: what is shown, what is typed, what is downloaded."""

    def __init__(self, session: Any, address: str, socket: Any) -> None:
        self.session, self.address, self.socket = session, address, socket
        from emulator import Picture

        self.picture = Picture(200, 60)  # only cells that change are sent
        self.decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self.keys: list[str] = []

    async def until(self, wanted: Callable[[], bool]) -> None:
        while not wanted():
            try:
                message = await asyncio.wait_for(self.socket.receive(), 60)
            except TimeoutError:
                pytest.fail("it did not come:\n" + "\n".join(self.picture.lines()))
            if message.type == aiohttp.WSMsgType.BINARY:
                self.picture.feed(self.decoder.decode(message.data))
            elif message.type == aiohttp.WSMsgType.TEXT:
                kind, value = json.loads(message.data)
                self.keys += [value] if kind == "deliver_file_start" else []
            else:
                raise AssertionError(f"it ended: {message}")

    async def shows(self, text: str) -> None:
        await self.until(lambda: text in "\n".join(self.picture.lines()))

    async def type(self, keys: str) -> None:
        await self.socket.send_str(json.dumps(["stdin", keys]))

    async def answer(self, text: str) -> None:
        """Type into a line that has something in it; Textual runs Ctrl+U after letters that come at once with it."""
        for keys in ("\x15", text, "\r"):
            await self.type(keys)
            await asyncio.sleep(0.5)

    async def downloaded(self) -> tuple[str, bytes]:
        await self.until(lambda: bool(self.keys))
        async with self.session.get(f"{origin(self.address)}/download/{self.keys.pop()}") as answer:
            assert answer.status == 200
            return answer.headers["Content-Disposition"], await answer.read()


def origin(address: str) -> str:
    return "/".join(address.split("/")[:3])


def browse(address: str, work: Callable[[Browser], Awaitable[None]], **headers: str) -> None:
    """Open a tab as a browser does: the page, then the socket that the page names."""

    async def main() -> None:
        async with aiohttp.ClientSession() as session:
            async with session.get(address) as page:
                assert page.status == 200
                url = re.search(r'data-session-websocket-url="([^"]+)"', await page.text())
            assert url is not None
            asked = {"Origin": origin(address), **headers}
            async with session.ws_connect(f"{url[1]}?width=120&height=40", headers=asked) as socket:
                await work(Browser(session, address, socket))

    asyncio.run(main())


def status(url: str, **headers: str) -> int:
    """What the server says to a request."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=20) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


@posix
def test_the_page_shows_the_capture_and_listens_on_loopback_only(address: str) -> None:
    async def work(tab: Browser) -> None:
        await tab.shows("Transactions")

    browse(address, work)
    other = _other_address()
    if other is not None:
        with socket.socket() as client:
            client.settimeout(2)
            assert client.connect_ex((other, int(address.split(":")[2].split("/")[0]))) != 0


@posix
def test_a_page_is_filled_to_its_last_row_and_column_when_it_grows_too(address: str) -> None:
    async def work(tab: Browser) -> None:
        await tab.until(lambda: "165 frames" in tab.picture.lines()[38])
        await tab.socket.send_str(json.dumps(["resize", {"width": 170, "height": 50}]))
        await tab.until(lambda: "165 frames" in tab.picture.lines()[48])
        await tab.until(lambda: any(len(line) > 120 for line in tab.picture.lines()))

    browse(address, work)


@posix
def test_keys_need_no_click_first(address: str) -> None:
    """The page hands the focus to the terminal, at its first byte and whenever it is come back to."""
    with urllib.request.urlopen(address, timeout=20) as answer:
        text = answer.read().decode()
    given = re.search(r'const typed = \(\) => document\.querySelector\("#terminal textarea"\)\?\.focus\(\);', text)
    assert given is not None
    assert 'new MutationObserver(typed).observe(document.body, {attributeFilter: ["class"]});' in text
    assert 'addEventListener("focus", typed);' in text


def test_without_the_token_there_is_nothing(address: str, folder: Path) -> None:
    port, token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{32})/", address).groups()  # type: ignore[union-attr]
    base = f"http://127.0.0.1:{port}"
    assert status(address) == 200
    assert status(f"{base}/{token}/static/js/textual.js") == 200
    for path in (
        "",
        "/",
        "/ws",
        "/static/",
        "/static/js/textual.js",
        f"/{token[:-1]}/",
        f"/{'x' * 32}/",
        f"/{token}x/",
    ):
        assert status(base + path) == 403, path
    for path in (f"/{token}/static/", f"/{token}/static/js/", f"/{token}/static/../server.py", "/download/none"):
        assert status(base + path) in (403, 404), path
    with served(folder) as another:
        assert another.split("/")[3] != token


@posix
@pytest.mark.parametrize(
    "headers",
    [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": "http://127.0.0.1:1"}, {"Host": "evil.example"},
     {"Origin": "https://{host}"}, {"Host": "evil.example", "Origin": "http://evil.example"}, {"Host": "192.0.2.1"},
     {"Host": "127.0.0.1.evil.example"}, {"Host": "[::ffff:7f00:1"}, {"Host": "[::1"}, {"Host": "localhost.evil"},
     {"Host": ""}],
)  # fmt: skip
def test_pages_and_names_of_others_are_refused(address: str, headers: dict[str, str]) -> None:
    host = address.split("/")[2]
    headers = {name: value.format(host=host) if "{" in value else value for name, value in headers.items()}

    async def connect() -> int:
        async with aiohttp.ClientSession() as session:
            try:
                async with session.ws_connect(address.replace("http", "ws") + "ws?width=80&height=24", headers=headers):
                    return 101
            except aiohttp.WSServerHandshakeError as error:
                return int(error.status)

    assert status(address, **headers) in (400, 403)
    assert asyncio.run(connect()) in (400, 403)


@posix
def test_own_names_and_forwarded_ports_are_let_in(address: str) -> None:
    for host in ("localhost:9000", "127.0.0.1", "[::1]:8000", "LOCALHOST"):
        assert status(address, Host=host, Origin=f"http://{host}") == 200, host
    with urllib.request.urlopen(address, timeout=20) as page:
        policy = page.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
        assert page.headers["Referrer-Policy"] == "no-referrer" and page.headers["X-Frame-Options"] == "DENY"


@posix
def test_an_export_is_a_download_and_nothing_is_written_here(address: str, folder: Path, tmp_path: Path) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}

    async def work(tab: Browser) -> None:
        await tab.shows("Transactions")
        await tab.type("2")
        await tab.shows("holding registers")
        await tab.type("m")
        await tab.until(lambda: any(line.lstrip().startswith("*") for line in tab.picture.lines()))
        await tab.type(";")
        await tab.shows("Comment")
        await tab.answer("seen in a browser")
        await tab.shows("seen in a browser")
        await tab.type("e")
        await tab.shows("Download")
        await tab.answer(f"{tmp_path}/owned.csv")
        await tab.shows("plain name")
        await tab.answer("../owned.csv")
        await tab.answer("frames.csv")
        name, data = await tab.downloaded()
        assert "frames.csv" in name
        rows = list(csv.reader(io.StringIO(data.decode())))
        assert len(rows) > 100 and "unit" in rows[0]

    browse(address, work)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    assert not list(tmp_path.iterdir())
    assert not (folder.parent / "owned.csv").exists()


@posix
def test_a_file_that_goes_or_changes_does_not_end_the_page(tmp_path: Path) -> None:
    bus = tmp_path / "bus.jsonl"
    shutil.copy(samples.path("troubled.jsonl"), bus)

    async def work(tab: Browser) -> None:
        await tab.shows("165 frames")
        whole = bus.read_text().splitlines(keepends=True)
        bus.unlink()
        await tab.type("\x12")  # Ctrl+R
        await tab.shows("the view is unchanged")
        await tab.type("2")
        await tab.shows("holding registers")
        bus.write_text("".join(whole[: len(whole) // 2]))
        await tab.type("\x12")
        await tab.until(lambda: "165 frames" not in tab.picture.lines()[38] and "frames" in tab.picture.lines()[38])
        bus.write_text("".join(whole))
        await tab.type("\x12")
        await tab.until(lambda: "165 frames" in tab.picture.lines()[38])

    with served(tmp_path, "bus.jsonl") as address:
        browse(address, work)


def descendants(pid: int) -> list[int]:
    """Processes of a process, and theirs."""
    own = [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return [*own, *(each for child in own for each in descendants(child))]


def running(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc")
@pytest.mark.parametrize("ended", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_viewer_ends_with_its_server(tmp_path: Path, ended: signal.Signals) -> None:
    shutil.copy(samples.path("troubled.jsonl"), tmp_path / "bus.jsonl")
    command = [sys.executable, "-P", "-m", "analyzer.cli", "open", "--web", "--port", "0", "bus.jsonl"]
    server = subprocess.Popen(
        command, env=environment(), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    viewers: list[int] = []

    async def work(tab: Browser) -> None:
        await tab.shows("165 frames")
        viewers.extend(descendants(server.pid))
        server.send_signal(ended)
        for _ in range(600):
            if not any(map(running, viewers)):
                return
            await asyncio.sleep(0.05)

    try:
        assert server.stdout is not None
        browse(server.stdout.readline().strip(), work)
        assert viewers
        assert [pid for pid in viewers if running(pid)] == []
    finally:
        server.kill()
        _, told = server.communicate(timeout=PATIENCE_S)
    assert told.splitlines() == ["rtuscope: open this address in a browser; press Ctrl-C to stop"]


@posix
def test_functions_and_limits_go_along(tmp_path: Path) -> None:
    shutil.copy(samples.path("troubled.jsonl"), tmp_path / "-bus.jsonl")
    (tmp_path / "captures.py").write_text("raise SystemExit('a module of the folder was run')")
    (tmp_path / "f.py").write_text(
        "from construct import Pass\nfrom dissectors import Function\nA = Function(65, 'A', Pass, Pass)\n"
    )

    async def work(tab: Browser) -> None:
        await tab.shows("Transactions")

    with served(tmp_path, "--functions", "f.py", "--t35-ms", "2.5", "--", "-bus.jsonl") as address:
        browse(address, work)


def test_a_port_that_is_taken_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert f"cannot listen on 127.0.0.1:{port}" in refused(capsys, "open", "--web", "--port", str(port))
    assert "is not a port (0 to 65535)" in refused(capsys, "open", "--web", "--port", "70000")
    assert "cannot listen on no.such.invalid:80" in refused(
        capsys, "open", "--web", "--port", "80", "--host", "no.such.invalid"
    )


def test_a_server_for_others_goes_by_addresses_and_its_own_name() -> None:
    for host in ("192.168.1.5:8000", "[fe80::1]:8000", f"{socket.gethostname()}:8000", "localhost:1"):
        assert not refusal(host, [f"http://{host}"], "0.0.0.0"), host
    assert not refusal("bench.local:8000", [], "bench.local")
    for host in ("evil.example", "bench.local", "192.168.1.5.evil.example:8000", ""):
        assert refusal(host, [], "0.0.0.0"), host


_words = st.lists(st.text(st.sampled_from("a b\\%^&|<>()!;,='$`*?é№"), max_size=8), max_size=4)


@given(_words)
def test_a_windows_command_line_gives_the_same_arguments_back(arguments: list[str]) -> None:
    line = shell_command(["C:\\Program Files\\Python\\python.exe", *arguments], windows=True)
    assert as_windows_reads_it(line)[1:] == arguments


@posix
@given(_words)
def test_a_posix_command_line_gives_the_same_arguments_back(arguments: list[str]) -> None:
    import shlex

    assert shlex.split(shell_command(arguments, windows=False)) == arguments


def as_windows_reads_it(line: str) -> list[str]:
    """What cmd.exe leaves of a line, then what a program makes of that.

    cmd: a caret outside quotes takes the meaning from the next character; & | < > ( ) mean something outside quotes;
    a name between two % is a variable's, where one is set. Program: as CommandLineToArgvW.
    """
    for name in re.findall(r"%([^%]*)%", line):
        assert not name.strip("^").isalnum(), f"{name} would be a variable"
    left, quoted, i = "", False, 0
    while i < len(line):
        c = line[i]
        if c == '"':
            quoted = not quoted
        elif not quoted:
            assert c not in "&|<>()", line
            if c == "^":
                i += 1
                c = line[i]
        left += c
        i += 1
    return _argv(left)


def _argv(line: str) -> list[str]:
    arguments: list[str] = []
    current, quoted, begun, i = "", False, False, 0
    while i < len(line):
        slashes = len(line) - i - len(line[i:].lstrip("\\"))
        after = line[i + slashes : i + slashes + 1]
        if slashes:
            current += "\\" * (slashes // 2 if after == '"' else slashes)
            begun = True
            if after == '"' and slashes % 2:
                current += '"'
                slashes += 1
            i += slashes
            continue
        c = line[i]
        if c == '"':
            begun = True
            if quoted and line[i + 1 : i + 2] == '"':
                current += '"'
                i += 1
            else:
                quoted = not quoted
        elif c in " \t" and not quoted:
            if begun:
                arguments.append(current)
            current, begun = "", False
        else:
            current, begun = current + c, True
        i += 1
    return [*arguments, current] if begun else arguments


def _other_address() -> str | None:
    """An address of this machine other than loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return None
        address = str(probe.getsockname()[0])
    return None if address.startswith("127.") else address
