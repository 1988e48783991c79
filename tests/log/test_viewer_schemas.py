"""Viewers can read every schema: Foxglove drops a topic whose JSON Schema says more than it knows."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from pydantic import TypeAdapter

from mission.log.channels import RECORD_CHANNELS, json_schema
from mission.log.viewer_schema import simple_schema

WORDS = {"type", "title", "description", "enum", "properties", "required", "items"}
SCALARS = {"string", "number", "integer", "boolean"}


def nodes(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield schema
    for field in schema.get("properties", {}).values():
        yield from nodes(field)
    if "items" in schema:
        yield from nodes(schema["items"])


@pytest.mark.parametrize("record", [channel.record for channel in RECORD_CHANNELS])
def test_a_schema_holds_nothing_but_objects_lists_and_scalars(record: type) -> None:
    schema = json_schema(record)
    assert schema["type"] == "object"
    for node in nodes(schema):
        assert node.keys() <= WORDS
        assert node["type"] in {*SCALARS, "object", "array"}
        if node["type"] == "object":
            assert isinstance(node["properties"], dict)
            assert set(node["required"]) <= node["properties"].keys()
        if node["type"] == "array":
            assert node["items"]["type"] in {*SCALARS, "object"}


@dataclass
class Inner:
    down_m: float


@dataclass
class Outer:
    maybe: Inner | None
    pair: tuple[float, float]
    many: list[Inner]
    table: list[list[float]]
    words: dict[str, str]


@dataclass
class Either:
    one: int | str


def test_what_can_be_said_simply_is() -> None:
    schema = simple_schema(TypeAdapter(Outer).json_schema())
    fields = schema["properties"]
    assert fields.keys() == {"maybe", "pair", "many", "words"}
    assert schema["required"] == ["maybe", "pair", "many", "words"]
    assert fields["maybe"]["properties"]["down_m"]["type"] == "number"
    assert fields["pair"]["items"] == {"type": "number"}
    assert fields["many"]["items"]["properties"].keys() == {"down_m"}
    assert fields["words"]["properties"] == {}


def test_a_field_of_two_types_is_refused() -> None:
    with pytest.raises(ValueError, match="2 types"):
        simple_schema(TypeAdapter(Either).json_schema())
