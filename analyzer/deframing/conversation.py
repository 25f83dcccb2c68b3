"""Do these responses answer those requests? `dissectors.answers` for arrays of pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Asked, Echo, relations
from dissectors.limits import taken

from .rules import Bytes, Index, Mask, field


def fitting(data: Bytes, requests: Index, responses: Index) -> Mask:
    """For pairs of ADU starts: whether the response answers the request. Shape: that of the two arrays."""
    function = data.take(requests + 1)
    answer = data.take(responses + 1)
    fits: NDArray[np.bool_] = (data.take(requests) == data.take(responses)) & ((answer & 0x7F) == function)
    plain = fits & (answer == function)
    for code in np.bincount(function[plain]).nonzero()[0].tolist():
        which = (plain & (function == code)).nonzero()[0]
        request, response = requests.take(which), responses.take(which)
        agree = np.ones(len(which), np.bool_)
        for relation in relations(code):
            if isinstance(relation, Asked):
                quantity = field(data, request + relation.quantity_offset + 1, 2)
                count = field(data, response + relation.count_offset + 1, 1)
                agree &= count == (taken(quantity, relation.bits) & 0xFF)
            else:
                agree &= _echoed(data, request, response, relation)
        fits[which] = agree
    return fits


def _echoed(data: Bytes, request: Index, response: Index, echo: Echo) -> Mask:
    same = np.ones(len(request), np.bool_)
    for i in range(echo.width):
        same &= data.take(request + (echo.request_offset + 1 + i)) == data.take(
            response + (echo.response_offset + 1 + i)
        )
    return same
