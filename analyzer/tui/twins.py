"""Keys of another layout: with Cyrillic on, a letter key gives the letter that stands on it; it means the same key."""

from __future__ import annotations

from typing import Final

from textual.events import Key
from textual.keys import _character_to_key

_LATIN: Final = "qwertyuiop[]asdfghjkl;'zxcvbnm,./`"
_CYRILLIC: Final = "йцукенгшщзхъфывапролджэячсмитьбю.ё"
_UPPER: Final = 'QWERTYUIOP{}ASDFGHJKL:"ZXCVBNM<>?~'
TWINS: Final = {
    **{own: latin for own, latin in zip(_CYRILLIC, _LATIN, strict=True) if own != "."},
    **{own.upper(): latin for own, latin in zip(_CYRILLIC, _UPPER, strict=True) if own != "."},
}


def latin(event: Key) -> Key:
    """The key as the Latin layout has it; itself where it is no Cyrillic letter."""
    twin = TWINS.get(event.character or "")
    return event if twin is None else Key(twin if twin.isalpha() else _character_to_key(twin), twin)
