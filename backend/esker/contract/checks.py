"""What a client may send, as a table that other languages read: fields, their bounds, and which of them may be absent.

The table follows from the models of ``operations`` and ``messages``; ``contract/emit.py`` writes it for the page, which
checks each message before it sends it (``frontend/src/core/wire.ts``). Validators that change a value (``plain``) are
not in it: they refuse nothing.
"""

from __future__ import annotations

from typing import Any, Final

from pydantic.json_schema import JsonSchemaMode

from esker.contract.messages import CLIENT_MESSAGE
from esker.contract.operations import Group

SAFE_INTEGER: Final = 2**53 - 1
"""Greatest whole number that JSON carries exactly to every language."""
LARGEST: Final = 1.7976931348623157e308
"""Greatest double: a number without bounds of its own is finite all the same."""
_MODE: Final[JsonSchemaMode] = "validation"
_SAYS: Final = {
    "type",
    "const",
    "enum",
    "pattern",
    "minLength",
    "maxLength",
    "anyOf",
    "oneOf",
    "$ref",
    "items",
    "prefixItems",
} | {"minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "minItems", "maxItems"}
_SAYS_NOTHING: Final = {"default", "title", "description", "discriminator"}
"""Words of JSON Schema that the table has, and words that say nothing about what is well formed."""


def _name(ref: str) -> str:
    return ref.rsplit("/", 1)[1]


def _integer(node: dict[str, Any]) -> dict[str, Any]:
    """A whole number: bounds that are excluded become their neighbours."""
    low, high = node.get("minimum", -SAFE_INTEGER), node.get("maximum", SAFE_INTEGER)
    return {"integer": [node.get("exclusiveMinimum", low - 1) + 1, node.get("exclusiveMaximum", high + 1) - 1]}


def _number(node: dict[str, Any]) -> dict[str, Any]:
    """A number, with both bounds excluded where one is: ``ValueError`` where only one of them is."""
    excluded = [node[key] for key in ("exclusiveMinimum", "exclusiveMaximum") if key in node]
    if len(excluded) == 1:
        raise ValueError(f"only one end of {node} is excluded")
    return (
        {"between": excluded} if excluded else {"number": [node.get("minimum", -LARGEST), node.get("maximum", LARGEST)]}
    )


def _union(node: dict[str, Any]) -> dict[str, Any]:
    """One of several models by their ``type``, or something that may be null."""
    if "oneOf" in node:
        return {"union": [_name(choice["$ref"]) for choice in node["oneOf"]]}
    others = [choice for choice in node["anyOf"] if choice.get("type") != "null"]
    if len(others) != 1 or len(node["anyOf"]) != 2:
        raise ValueError(f"no check for {node}")
    return {"nullable": check(others[0])}


def check(node: dict[str, Any]) -> dict[str, Any]:
    """A node of JSON Schema as one of the page's checks; ``ValueError`` for a word that no check knows."""
    if unknown := set(node) - _SAYS - _SAYS_NOTHING:
        raise ValueError(f"no check for {sorted(unknown)} in {node}")
    if "$ref" in node:
        return {"model": _name(node["$ref"])}
    if "const" in node or "enum" in node:
        return {"oneOf": node["enum"] if "enum" in node else [node["const"]]}
    if "anyOf" in node or "oneOf" in node:
        return _union(node)
    match node.get("type"):
        case "string" if "pattern" in node:
            return {"matches": node["pattern"]} | ({"most": node["maxLength"]} if "maxLength" in node else {})
        case "string":
            return {"text": [node.get("minLength", 0), node.get("maxLength", SAFE_INTEGER)]}
        case "number":
            return _number(node)
        case "integer":
            return _integer(node)
        case "boolean":
            return {"bool": True}
        case "array" if "prefixItems" in node:
            return {"tuple": [check(item) for item in node["prefixItems"]]}
        case "array":
            return {
                "list": check(node["items"]),
                "length": [node.get("minItems", 0), node.get("maxItems", SAFE_INTEGER)],
            }
    raise ValueError(f"no check for {node}")


def models() -> dict[str, dict[str, dict[str, Any]]]:
    """The fields of each model that a client sends, or that stands in one: those that ``must`` be there, and others."""
    schema = CLIENT_MESSAGE.json_schema(mode=_MODE)
    table: dict[str, dict[str, dict[str, Any]]] = {}
    for name, definition in sorted(schema["$defs"].items()):
        table[name] = {"must": {}, "may": {}}
        for key, node in definition["properties"].items():
            # A constant has a default in Python, so that it need not be written there; on the wire it must be.
            required = "const" in node or key in definition.get("required", ())
            table[name]["must" if required else "may"][key] = check(node)
    return table


def unions() -> dict[str, list[str]]:
    """The models that a client may send as a message, and those that may stand as an op."""
    message = _union(CLIENT_MESSAGE.json_schema(mode=_MODE))["union"]
    simple = check(Group.model_json_schema(mode=_MODE)["properties"]["ops"])["list"]["union"]
    return {"ClientMessage": message, "Op": [*simple, Group.__name__]}
