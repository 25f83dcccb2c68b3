"""Paths that are no paths, wherever one is typed: each is answered by a line."""

from __future__ import annotations

import pytest

from analyzer.tui.openfiles import no_capture
from analyzer.tui.picking import _no_file
from dissectors.maps.files import read_map
from dissectors.maps.model import MapError

_NONE = ["x" * 400, "x" * 400 + "/y", "a\0b", "~nobody-there/x"]


@pytest.mark.parametrize("text", _NONE)
def test_what_cannot_be_a_path_is_told_in_a_line(text: str) -> None:
    assert no_capture(text).startswith("no file ")
    with pytest.raises(MapError):
        read_map(text)


@pytest.mark.parametrize("text", [each.rpartition("/")[0] or each for each in _NONE])
def test_no_folder_of_such_a_name_takes_an_export(text: str) -> None:
    assert _no_file(f"{text}/frames.csv").startswith("no folder ")
