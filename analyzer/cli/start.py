"""`rtuscope` alone on a terminal: the start screen, and the command that what was chosen there asks for."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from ..languages import error_words, tr
from .commands import UsageError
from .door import asked

if TYPE_CHECKING:
    from ..tui.start import AtHand

_PORTS: Final = 6  # listed at most; `rtuscope ports` has all
_SAMPLE: Final = "demo"


def choose() -> list[str] | None:
    """The command line that was asked for; None where the user left, or pasted bytes and has read them."""
    from ..tui import run
    from ..tui.start import begin

    wrong = ""
    while True:
        text = begin(list(_at_hand()), wrong)
        if text is None:
            return None
        if text == _SAMPLE:
            return [_SAMPLE]
        try:
            words = None if "\n" in text.strip() else asked([text.strip()])
        except UsageError as error:
            wrong = error_words(error)
            continue
        if words is None or words[0] == "parse":
            from ..model.source import Nothing

            run(Nothing(text), view="paste")
            return None
        return [*words, "--tui"] if words[0] == "sniff" else words


def _at_hand() -> Iterator[AtHand]:
    """Ports of this machine, captures that were opened lately, the sample."""
    from captures.live.ports import ports
    from captures.live.tap import PortError

    from ..tui.desk import Preferences
    from ..tui.start import AtHand

    with suppress(PortError):
        for port in ports()[:_PORTS]:
            words = port.advice or ", ".join(filter(None, (port.description, port.usb and f"USB {port.usb}")))
            yield AtHand("port", port.device, words)
    for name in reversed(Preferences.of_user().recent):
        if os.path.isfile(name):  # noqa: PTH113 - as everywhere before a command is chosen
            yield AtHand("capture", name)
    yield AtHand("sample", _SAMPLE, tr("a bus with troubles, bundled"))
