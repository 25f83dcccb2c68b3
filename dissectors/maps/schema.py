"""The JSON Schema of a map in YAML or JSON, made of the columns that are declared."""

from __future__ import annotations

from typing import Any

from dissectors.values import ORDERS

from .cells import COLUMNS


def json_schema() -> dict[str, Any]:
    """The schema; columns and header keys that it does not name are allowed and kept."""
    columns = {column.name: {**column.schema, "description": column.help} for column in COLUMNS}
    text = {"type": "string"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Register map",
        "type": "object",
        "required": ["registers"],
        "properties": {
            "device": {**text, "description": "what the device is called"},
            "vendor": {**text, "description": "who makes it"},
            "version": {"type": ["string", "number"], "description": "of the map"},
            "address_base": {"enum": [0, 1], "description": "the address of the first register"},
            "word_order": {"enum": list(ORDERS), "description": "where a row says none"},
            "match": {"type": ["object", "string"], "description": "what tells that a device is this one"},
            "source": {**text, "description": "where the facts come from"},
            "licence": {**text, "description": "on which terms the map may be used"},
            "registers": {
                "type": "array",
                "items": {"type": "object", "required": ["address", "name"], "properties": columns},
            },
        },
    }
