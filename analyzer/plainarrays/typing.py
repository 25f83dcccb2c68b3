"""What annotations name."""

from __future__ import annotations

from typing import Any, cast

from .array import ndarray
from .types import dtype


class NDArray:
    """`NDArray[uint8]` is an array of these."""

    def __class_getitem__(cls, scalar: Any) -> Any:
        array, kind = cast(Any, ndarray), cast(Any, dtype)
        return array[Any, kind[scalar]]


ArrayLike = Any
