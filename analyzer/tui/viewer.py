"""The interface in a browser's tab, a process of the server of `open --web`: it ends with that server.

Textual's driver stops reading where its input ends, as it does when the server is killed, and the application would
wait for keys for ever.
"""

from __future__ import annotations

import os
from typing import Any, Final

from textual import messages
from textual.driver import Driver

_PATIENCE_S: Final = 5.0


def ending_with_its_server(driver: type[Driver]) -> type[Driver]:
    """The same driver, for Textual's in a browser; others end with their terminal."""
    from textual.drivers.web_driver import WebDriver

    if not issubclass(driver, WebDriver):
        return driver

    class ViewerDriver(WebDriver):
        def run_input_thread(self) -> None:
            super().run_input_thread()
            if self.exit_event.is_set():
                return
            self._app.post_message(messages.ExitApp())
            if not self.exit_event.wait(_PATIENCE_S):  # nobody takes what it writes, nor waits for its status
                os._exit(1)

        def stop_application_mode(self, *arguments: Any) -> None:
            try:
                super().stop_application_mode(*arguments)
            except BrokenPipeError:  # the server is gone: nobody is to be told
                self.exit_event.set()

    return ViewerDriver
