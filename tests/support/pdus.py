"""PDUs of every function and role, as hypothesis makes them: what construct builds from the declarations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import strategies as st

from dissectors.functions import function
from dissectors.length_rules import Role

WORD = st.integers(0, 0xFFFF)
BYTE = st.integers(0, 0xFF)
Values = dict[str, Any]
Made = st.SearchStrategy[Values]

REQUEST, RESPONSE = Role.REQUEST, Role.RESPONSE


def words(least: int, most: int) -> st.SearchStrategy[list[int]]:
    return st.lists(WORD, min_size=least, max_size=most)


def fixed(**parts: st.SearchStrategy[Any]) -> Made:
    return st.fixed_dictionaries(parts)


def read_request(most: int) -> Made:
    return fixed(starting_address=WORD, quantity=st.integers(1, most))


def registers_read(values: list[int]) -> Values:
    return {"byte_count": 2 * len(values), "registers": values}


def bits_read(name: str) -> Callable[[list[bool]], Values]:
    return lambda values: {"byte_count": (len(values) + 7) // 8, name: values}


def bits(most: int) -> st.SearchStrategy[list[bool]]:
    return st.lists(st.booleans(), min_size=1, max_size=most)


COIL = fixed(output_address=WORD, output_value=st.sampled_from([0xFF00, 0]))
REGISTER = fixed(register_address=WORD, register_value=WORD)
WRITTEN = fixed(starting_address=WORD, quantity=st.integers(1, 123))
MASKS = fixed(reference_address=WORD, and_mask=WORD, or_mask=WORD)
NOTHING: Made = st.just({})
STATUS = st.sampled_from([0, 0xFFFF])
SUB_REQUEST = fixed(
    reference_type=st.just(6),
    file_number=st.integers(1, 0xFFFF),
    record_number=st.integers(0, 9999),
    record_length=WORD,
)
SUB_RESPONSE = words(1, 20).map(
    lambda v: {"file_response_length": 1 + 2 * len(v), "reference_type": 6, "record_data": v}
)
SUB_WRITE = st.builds(
    lambda group, data: {**group, "record_length": len(data), "record_data": data}, SUB_REQUEST, words(1, 20)
)
OBJECT = st.builds(
    lambda code, value: {"object_id": code, "object_length": len(value), "object_value": value},
    BYTE,
    st.binary(max_size=30),
)


def written(count: Callable[[list[Any]], int], name: str) -> Callable[[int, list[Any]], Values]:
    return lambda address, values: {
        "starting_address": address,
        "quantity": len(values),
        "byte_count": count(values),
        name: values,
    }


def groups(name: str, element: Made, most: int, size: Callable[[Values], int]) -> Made:
    return st.lists(element, min_size=1, max_size=most).map(
        lambda found: {"byte_count": sum(map(size, found)), name: found}
    )


def identification(objects: list[Values]) -> Values:
    return {
        "mei_type": 0x0E,
        "mei_data": {
            "read_device_id_code": 1,
            "conformity_level": 0x81,
            "more_follows": 0,
            "next_object_id": 0,
            "number_of_objects": len(objects),
            "objects": objects,
        },
    }


CASES: dict[tuple[int, Role], Made] = {
    (0x01, REQUEST): read_request(2000),
    (0x01, RESPONSE): bits(2000).map(bits_read("coils")),
    (0x02, REQUEST): read_request(2000),
    (0x02, RESPONSE): bits(2000).map(bits_read("inputs")),
    (0x03, REQUEST): read_request(125),
    (0x03, RESPONSE): words(1, 125).map(registers_read),
    (0x04, REQUEST): read_request(125),
    (0x04, RESPONSE): words(1, 125).map(registers_read),
    (0x05, REQUEST): COIL,
    (0x05, RESPONSE): COIL,
    (0x06, REQUEST): REGISTER,
    (0x06, RESPONSE): REGISTER,
    (0x07, REQUEST): NOTHING,
    (0x07, RESPONSE): fixed(output_data=BYTE),
    (0x08, REQUEST): fixed(sub_function=st.just(1), data=st.sampled_from([0, 0xFF00])),
    (0x08, RESPONSE): fixed(sub_function=st.integers(11, 18), data=WORD),
    (0x0B, REQUEST): NOTHING,
    (0x0B, RESPONSE): fixed(status=STATUS, event_count=WORD),
    (0x0C, REQUEST): NOTHING,
    (0x0C, RESPONSE): st.builds(
        lambda events, a, b: {
            "byte_count": 6 + len(events),
            "status": 0,
            "event_count": a,
            "message_count": b,
            "events": events,
        },
        st.binary(max_size=64),
        WORD,
        WORD,
    ),
    (0x0F, REQUEST): st.builds(written(lambda v: (len(v) + 7) // 8, "coils"), WORD, bits(1968)),
    (0x0F, RESPONSE): WRITTEN,
    (0x10, REQUEST): st.builds(written(lambda v: 2 * len(v), "registers"), WORD, words(1, 123)),
    (0x10, RESPONSE): WRITTEN,
    (0x11, REQUEST): NOTHING,
    (0x11, RESPONSE): st.binary(min_size=1, max_size=251).map(lambda data: {"byte_count": len(data), "data": data}),
    (0x14, REQUEST): groups("sub_requests", SUB_REQUEST, 35, lambda _: 7),
    (0x14, RESPONSE): groups("sub_responses", SUB_RESPONSE, 5, lambda v: 2 + 2 * len(v["record_data"])),
    (0x15, REQUEST): groups("sub_requests", SUB_WRITE, 5, lambda v: 7 + 2 * len(v["record_data"])),
    (0x15, RESPONSE): groups("sub_requests", SUB_WRITE, 5, lambda v: 7 + 2 * len(v["record_data"])),
    (0x16, REQUEST): MASKS,
    (0x16, RESPONSE): MASKS,
    (0x17, REQUEST): st.builds(
        lambda at, n, to, values: {
            "read_starting_address": at,
            "quantity_to_read": n,
            "write_starting_address": to,
            "quantity_to_write": len(values),
            "write_byte_count": 2 * len(values),
            "write_registers": values,
        },
        WORD,
        st.integers(1, 125),
        WORD,
        words(1, 121),
    ),
    (0x17, RESPONSE): words(1, 125).map(registers_read),
    (0x18, REQUEST): fixed(fifo_pointer_address=WORD),
    (0x18, RESPONSE): words(0, 31).map(lambda v: {"byte_count": 2 + 2 * len(v), "fifo_count": len(v), "registers": v}),
    (0x2B, REQUEST): fixed(
        mei_type=st.just(0x0E), mei_data=fixed(read_device_id_code=st.integers(1, 4), object_id=BYTE)
    ),
    (0x2B, RESPONSE): st.lists(OBJECT, max_size=7).map(identification),
}


def built(code: int, role: Role, values: Values) -> bytes:
    declared = function(code)
    assert declared is not None
    declaration = declared.request if role is Role.REQUEST else declared.response
    return bytes([code]) + declaration.build(values)
