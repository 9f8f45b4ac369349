"""Examples of answers and questions, put together from those of their fields."""

from collections.abc import Mapping
from typing import Any

from service.api.example_values import CHOSEN, KEYS, NUMBERS, WORDS


class Examples:
    """Makes examples for the schemas of a description.

    Parameters
    ----------
    schemas
        Those that references lead to.
    """

    def __init__(self, schemas: Mapping[str, Any]) -> None:
        self._schemas = schemas

    def of(self, schema: Mapping[str, Any], model: str = "", field: str = "") -> Any:
        """An example that fits a schema.

        Parameters
        ----------
        model, field
            Where it stands: that tells which word fits.
        """
        if (model, field) in CHOSEN:
            return CHOSEN[model, field]
        for given in ("examples", "enum"):
            if schema.get(given):
                return schema[given][0]
        if "const" in schema:
            return schema["const"]
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            return self.of(self._schemas[name], name, field)
        if "anyOf" in schema:
            return self._one_of(schema["anyOf"], model, field)
        return self._of_type(schema, model, field)

    def _one_of(self, choices: list[Mapping[str, Any]], model: str, field: str) -> Any:
        """The first that says more than nothing; a word that nobody knows may as well be null."""
        may_be_null = any(choice.get("type") == "null" for choice in choices)
        some = [choice for choice in choices if choice.get("type") != "null"]
        is_word = some[0].get("type") == "string" and not some[0].get("examples")
        unknown = is_word and "enum" not in some[0] and field not in WORDS
        return None if may_be_null and unknown else self.of(some[0], model, field)

    def _of_type(self, schema: Mapping[str, Any], model: str, field: str) -> Any:
        match schema.get("type"):
            case "object":
                return self._object(schema, model, field)
            case "array":
                items = schema.get("prefixItems") or [schema.get("items", {})]
                return [self.of(item, model, field) for item in items]
            case "string":
                return WORDS.get(field) or field or "text"
            case "integer":
                return _within(schema, NUMBERS.get(field, 0))
            case "number":
                return _within(schema, NUMBERS.get(field, 1.5))
            case "boolean":
                return False
            case _:
                return None

    def _object(self, schema: Mapping[str, Any], model: str, field: str) -> Any:
        if "properties" in schema:
            return {name: self.of(its, model, name) for name, its in schema["properties"].items()}
        its = schema.get("additionalProperties")
        if not isinstance(its, Mapping):
            return {}
        names = schema.get("propertyNames", {})
        key = self.of(names) if names else KEYS.get(field, "name")
        return {key: self.of(its, model, field)}


def _within(schema: Mapping[str, Any], number: float) -> float:
    lowest: float = schema.get("minimum", number)
    highest: float = schema.get("maximum", number)
    return min(max(number, lowest), highest)
