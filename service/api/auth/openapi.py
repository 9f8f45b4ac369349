"""What the published description says of access: schemes, and what each operation needs."""

from collections.abc import Mapping
from typing import Any

from service.api.auth.credentials import COOKIE
from service.api.auth.declared import Declared

SCHEMES = {
    "session": {
        "type": "apiKey",
        "in": "cookie",
        "name": COOKIE,
        "description": "A login of a person (POST /api/v1/session).",
    },
    "key": {
        "type": "http",
        "scheme": "bearer",
        "description": "A key of a machine (padwatch keys create).",
    },
}

NEEDED = "x-padwatch-needs"
"""Permission that an operation needs; null where it is open."""

SAID = {
    401: "Nobody in particular asks",
    403: "Not allowed, or asked for by a page of another site",
}


def describe_access(document: dict[str, Any], operations: Mapping[str, Declared]) -> None:
    """Add to a description what each operation needs, and how one shows who one is."""
    document.setdefault("components", {})["securitySchemes"] = SCHEMES
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            one = operations[f"{method.upper()} {path}"]
            operation[NEEDED] = one.needs.permission
            operation["security"] = [] if one.is_open else [{"session": []}, {"key": []}]
            if not one.is_open:
                _add_refusals(operation["responses"])


def _add_refusals(responses: dict[str, Any]) -> None:
    for status, said in SAID.items():
        responses.setdefault(str(status), {**responses["default"], "description": said})
