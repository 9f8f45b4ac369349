"""Additions to the OpenAPI document: operation ids, headers, examples, required permissions."""

from collections.abc import Mapping
from typing import Any

from service.api.answers import EDITION_HEADER, ORIGIN_HEADER, TIME_HEADER
from service.api.auth.authenticator import COOKIE
from service.api.auth.declared import Declared
from service.api.problems import problem_schemas

UNIT, BEARING, CHANNEL = "U1", "UJB", "ujb_shaft_x"
QUANTITY, ALARM = "order1_k_eff_xx_n_per_m", "U1:UJB:oil_temperature"

WORDS = {
    "unit": UNIT,
    "bearing": BEARING,
    "subject": BEARING,
    "bearing_ids": BEARING,
    "channels": CHANNEL,
    "name": "Unit 1",
    "label": "Effective stiffness x, 1×",
    "actor": "A. Name",
    "author": "A. Name",
    "event": "pads renewed",
    "reason": "ok",
    "checks": "ok",
    "missing": "the waveform: nothing was recorded then",
    "made_by": "padwatch 1.0.0",
    "hash": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "previous_hash": "60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558b3f8a2c",
    "sha256": "2c26b46b68ffc68ff99b453c1d30413413422d706483bfa0f98a5e886266e7ae",
}
"""Example texts by field name."""

NUMBERS = {
    "rated_speed_rpm": 90.9,
    "rate_hz": 600.0,
    "sampling_hz": 600.0,
    "refresh_s": 0.853,
    "poll_period_s": 0.5,
    "age_s": 0.4,
    "data_age_s": 0.4,
    "offset_s": 0.002,
    "drift_ppm": 3.1,
    "drift_uncertainty_ppm": 0.4,
    "n_offered": 361_472,
    "n_stored": 361_472,
    "first_index": 209_920,
    "last_index": 361_471,
    "n_segments": 20,
    "n_segments_wanted": 20,
    "coverage": 1.0,
    "duration_s": 252.6,
    "random": 2.1e6,
    "systematic": 9.8e6,
    "low_95": 0.6718e9,
    "high_95": 0.7110e9,
    "bracket_stiffness_n_per_m": 1.18e9,
    "clearance_um": 250.0,
    "bucket_s": 60.0,
    "n": 412,
}
"""Example numbers by field name."""

CHOSEN = {
    ("SourceModel", "state"): "connected",
    ("SourceModel", "reason"): None,
    ("SourceModel", "rejected"): {},
    ("SourceHealthModel", "state"): "connected",
    ("SourceHealthModel", "reason"): None,
    ("SourceHealthModel", "rejected"): {},
    ("SourceHealthModel", "refused_frames"): {},
    ("DeviceClockModel", "stamp_fault"): None,
    ("QualityModel", "reason"): "ok",
    ("LatestModel", "estimators"): {"xx": "dynamic", "yy": "dynamic"},
    ("AlarmListModel", "unjudged"): [],
    ("AlarmModel", "state"): "unacknowledged",
    ("AlarmModel", "is_active"): True,
    ("AlarmModel", "condition_reason"): "limit",
    ("AlarmModel", "film"): None,
    ("AlarmModel", "shelf"): None,
    ("AlarmModel", "outage"): None,
    ("FilmWordModel", "level"): None,
    ("TrendModel", "time"): [1_795_248_192.4],
    ("TrendModel", "next_cursor"): None,
    ("TrendModel", "simulated_until"): None,
    ("TrendModel", "coarse_until"): None,
    ("TrendModel", "groups"): None,
    ("TrendSeriesModel", "min"): [0.6893e9],
    ("TrendSeriesModel", "max"): [0.6931e9],
    ("TrendSeriesModel", "mean"): [0.6914e9],
    ("TrendSeriesModel", "count"): [70],
    ("TrendSeriesModel", "u_random"): [2.1e6],
    ("TrendSeriesModel", "u_systematic"): [9.8e6],
    ("TrendSeriesModel", "unit"): "N/m",
    ("UnitModel", "id"): UNIT,
    ("UnitOverviewModel", "id"): UNIT,
    ("BearingModel", "id"): BEARING,
    ("RecordedChannelModel", "id"): CHANNEL,
    ("RecordedSlowModel", "id"): "ujb_oil_temperature",
    ("RecordedSlowModel", "unit"): "°C",
    ("PlantModel", "name"): "Demonstration plant",
    ("QuantityModel", "name"): QUANTITY,
    ("QuantityModel", "unit"): "N/m",
}
"""Example values by model and field name."""

KEYS = {
    "readings": QUANTITY,
    "budgets": QUANTITY,
    "series": QUANTITY,
    "vectors": "shaft_x",
    "channels": "shaft_x",
    "units": UNIT,
    "checks": "store",
    "rejected": "checksum",
    "estimators": "xx",
    "lines": "order1",
    "chattering": ALARM,
    "files": "readings.parquet",
}
"""Example keys of JSON objects by field name."""


class Examples:
    """Generator of examples for the schemas of an OpenAPI document.

    Parameters
    ----------
    schemas
        Schemas of the document by name, to which other schemas refer.
    """

    def __init__(self, schemas: Mapping[str, Any]) -> None:
        self._schemas = schemas

    def of(self, schema: Mapping[str, Any], model: str = "", field: str = "") -> Any:
        """Return an example value for a schema.

        Parameters
        ----------
        model, field
            Names of the model and of its field with this schema; empty if unknown.
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
        """Return an example of the first non-null type; None for nullable text without example."""
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


JSON = "application/json"

IF_NONE_MATCH: dict[str, Any] = {
    "name": "If-None-Match",
    "in": "header",
    "required": False,
    "description": "`ETag` of a cached answer: 304 if it is unchanged.",
    "schema": {"type": "string"},
    "example": 'W/"1f2e3d4c5b6a79880716253f"',
}

ETAG = {
    "description": "Tag of the content, ignoring ages and the present time.",
    "schema": {"type": "string"},
    "example": IF_NONE_MATCH["example"],
}

HEADERS = {
    TIME_HEADER: {
        "description": "Time of the answer, from which ages in a cached answer advance.",
        "schema": {"type": "string"},
        "example": "2026-11-21T09:03:12.400Z",
    },
    ORIGIN_HEADER: {
        "description": "Live data or replay of a recording.",
        "schema": {"type": "string", "enum": ["live", "replay"]},
        "example": "live",
    },
    EDITION_HEADER: {
        "description": "Version of the program; changes with an upgrade.",
        "schema": {"type": "string"},
        "example": "1.0.0-1f2e3d4c",
    },
}
"""OpenAPI entries for the headers of successful answers, by name of the header."""

PROBLEM_HEADERS: dict[str, dict[str, Any]] = {
    "401": {
        "WWW-Authenticate": {
            "description": "How a machine authenticates.",
            "schema": {"type": "string"},
            "example": 'Bearer realm="padwatch"',
        }
    },
    "429": {
        "Retry-After": {
            "description": "Time to wait before the next request, s.",
            "schema": {"type": "integer"},
            "example": 4,
        }
    },
}
"""OpenAPI entries for the headers of problems, by status."""

NOT_MODIFIED = {
    "description": "Unchanged since the answer of that `ETag`",
    "headers": {"ETag": ETAG, **HEADERS},
}


def describe_answers(document: dict[str, Any]) -> None:
    """Add operation ids, examples, headers and entity tags to an OpenAPI document."""
    schemas = document.setdefault("components", {}).setdefault("schemas", {})
    schemas.update(problem_schemas())
    examples = Examples(schemas)
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            operation["operationId"] = operation_id(method, path)
            _add_examples(operation, examples)
            if path.startswith("/api/"):
                _add_headers(operation)
            if method == "get" and path.startswith("/api/"):
                _add_tags(operation)


def operation_id(method: str, path: str) -> str:
    """Return the operation id of a method and path, such as ``get_units_unit_bearings``."""
    words = path.removeprefix("/api/v1/").strip("/").translate(str.maketrans("/-.", "___", "{}"))
    return f"{method}_{words}"


def _add_examples(operation: dict[str, Any], examples: Examples) -> None:
    answers = [
        answer for status, answer in operation["responses"].items() if status.startswith("2")
    ]
    for body in (*answers, operation.get("requestBody", {})):
        content = body.get("content", {}).get(JSON)
        if content and "schema" in content and not {"example", "examples"} & set(content):
            content["example"] = examples.of(content["schema"])


def _add_headers(operation: dict[str, Any]) -> None:
    for status, answer in operation["responses"].items():
        common = HEADERS if status.startswith("2") else PROBLEM_HEADERS.get(status, {})
        if common:
            answer["headers"] = {**common, **answer.get("headers", {})}


def _add_tags(operation: dict[str, Any]) -> None:
    answer = operation["responses"]["200"]
    if JSON in answer.get("content", {}):
        operation.setdefault("parameters", []).append(IF_NONE_MATCH)
        operation["responses"]["304"] = NOT_MODIFIED
        answer["headers"] = {"ETag": ETAG, **answer["headers"]}


SCHEMES = {
    "session": {
        "type": "apiKey",
        "in": "cookie",
        "name": COOKIE,
        "description": "Session cookie of a person (POST /api/v1/session).",
    },
    "key": {
        "type": "http",
        "scheme": "bearer",
        "description": "API key of a machine (padwatch keys create).",
    },
}

NEEDED = "x-padwatch-needs"
"""OpenAPI extension with the permission that an operation requires; null if it is open."""

REFUSALS = {
    401: "Not authenticated",
    403: "Not allowed, or requested by a page of another site",
}


def describe_access(document: dict[str, Any], operations: Mapping[str, Declared]) -> None:
    """Add security schemes and required permissions of operations to an OpenAPI document."""
    document.setdefault("components", {})["securitySchemes"] = SCHEMES
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            one = operations[f"{method.upper()} {path}"]
            operation[NEEDED] = one.needs.permission
            operation["security"] = [] if one.is_open else [{"session": []}, {"key": []}]
            if not one.is_open:
                _add_refusals(operation["responses"])


def _add_refusals(responses: dict[str, Any]) -> None:
    for status, text in REFUSALS.items():
        responses.setdefault(str(status), {**responses["default"], "description": text})
