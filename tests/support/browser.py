"""A headless Chromium that a test drives over a pipe, and a server on this machine that hears what is asked of it."""

from __future__ import annotations

import base64
import contextlib
import functools
import json
import os
import select
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Final

from running import PATIENCE_S

_NAMES: Final = ("chromium", "chromium-browser", "google-chrome", "chrome")
_FLAGS: Final = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run",
                 "--disable-component-update", "--disable-sync", "--remote-debugging-pipe",
                 "--window-size=1280,900")  # fmt: skip


def chromium() -> str | None:
    """The browser's program, where there is one."""
    return next((found for name in _NAMES if (found := shutil.which(name))), None)


class _Heard(SimpleHTTPRequestHandler):
    """Files of a folder; `heard` are the paths that were asked for."""

    heard: list[str]

    def log_message(self, *_: object) -> None:
        """Say nothing."""

    def do_GET(self) -> None:
        self.heard.append(self.path)
        super().do_GET()


@contextlib.contextmanager
def served(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """The address of a server of a folder, and what is asked of it."""
    heard: list[str] = []
    handler = type("Heard", (_Heard,), {"heard": heard})
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(handler, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/", heard
    finally:
        server.shutdown()
        server.server_close()


class Browser:
    """One tab of it, by the DevTools protocol. A context manager; `asked` are the addresses it sent requests to."""

    def __init__(self, profile: Path) -> None:
        program = chromium()
        assert program is not None
        to_read, self._write = os.pipe()
        self._read, to_write = os.pipe()

        def placed() -> None:
            os.dup2(to_read, 3, inheritable=True)
            os.dup2(to_write, 4, inheritable=True)

        command = [program, *_FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._process = subprocess.Popen(
            command, preexec_fn=placed, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(to_read)
        os.close(to_write)
        self._held, self._number, self.asked = b"", 0, list[str]()
        targets = self._call("Target.getTargets")["targetInfos"]
        page = next(each["targetId"] for each in targets if each["type"] == "page")
        self._session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        self.call("Network.enable")
        self.call("Page.enable")
        self.call("Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=False, flatten=True)

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._write)
        self._process.kill()
        self._process.wait()
        os.close(self._read)

    def call(self, method: str, **given: Any) -> Any:
        """A command to the tab, and what it gives."""
        return self._call(method, self._session, **given)

    def go(self, url: str) -> None:
        """Open an address."""
        self.call("Page.navigate", url=url)

    def value(self, script: str) -> Any:
        """What an expression in the page comes to."""
        found = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def wait_for(self, script: str) -> float:
        """Wait until an expression is true; gives the seconds that took."""
        begun = time.monotonic()
        while not self.value(script):
            assert time.monotonic() - begun < PATIENCE_S, script
            time.sleep(0.05)
        return time.monotonic() - begun

    def picture(self, path: Path) -> None:
        """What is seen, as a PNG file."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def _call(self, method: str, session: str | None = None, **given: Any) -> Any:
        self._number += 1
        message = {"id": self._number, "method": method, "params": given}
        if session is not None:
            message["sessionId"] = session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("method") == "Network.requestWillBeSent":
                self.asked.append(answer["params"]["request"]["url"])
            if answer.get("method") == "Target.attachedToTarget" and self._number > 3:
                self._listen(answer["params"]["sessionId"])
            if answer.get("id") == message["id"]:
                assert "error" not in answer, answer
                return answer["result"]

    def _listen(self, session: str) -> None:
        """Hear what a worker asks for, too."""
        message = {"id": 1_000_000, "method": "Network.enable", "params": {}, "sessionId": session}
        os.write(self._write, json.dumps(message).encode() + b"\0")

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._held:
            ready, _, _ = select.select([self._read], [], [], PATIENCE_S)
            assert ready, "the browser says nothing"
            self._held += os.read(self._read, 1 << 16)
        message, _, self._held = self._held.partition(b"\0")
        decoded: dict[str, Any] = json.loads(message)
        return decoded
