"""JSON Schemas in the few words that viewers know: Foxglove drops a topic whose schema says more."""

from typing import Any

Schema = dict[str, Any]

_KEPT = ("type", "title", "description", "enum")


def simple_schema(schema: Schema) -> Schema:
    """Say an object's JSON Schema, as pydantic makes it, in types, properties and items alone.

    References are filled in, what may be null stands as what it is otherwise, a tuple as a list of its first item's
    type. Lists of lists are left out: what a schema does not name is in the messages all the same. Raises ValueError
    for a field that may be of two types. Source: Foxglove Studio 1.48, `parseJsonSchema`, which refuses all of these.
    """
    simple = _simple(schema, schema.get("$defs", {}))
    if simple is None:
        raise ValueError("no object")
    return simple


def _simple(schema: Schema, definitions: dict[str, Schema]) -> Schema | None:
    """None for a list of lists."""
    if "$ref" in schema:
        return _simple(definitions[schema["$ref"].rpartition("/")[2]], definitions)
    if "anyOf" in schema:
        options = [option for option in schema["anyOf"] if option.get("type") != "null"]
        if len(options) != 1:
            raise ValueError(f"{schema.get('title', 'a field')} may be of {len(options)} types")
        return _simple(options[0], definitions)
    simple = {key: schema[key] for key in _KEPT if key in schema}
    if schema["type"] == "object":
        fields = {name: _simple(field, definitions) for name, field in schema.get("properties", {}).items()}
        simple["properties"] = {name: field for name, field in fields.items() if field is not None}
        simple["required"] = [name for name in schema.get("required", []) if name in simple["properties"]]
    elif schema["type"] == "array":
        items = _simple(schema["items"] if "items" in schema else schema["prefixItems"][0], definitions)
        if items is None or items["type"] == "array":
            return None
        simple["items"] = items
    return simple
