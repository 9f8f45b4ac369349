"""Which methods a path has: those of the operations that fit it most closely."""

from collections.abc import Mapping
from typing import Any

METHODS = ("get", "put", "post", "delete", "patch", "options", "head", "trace")


def allowed_methods(paths: Mapping[str, Mapping[str, Any]], path: str) -> list[str]:
    """The methods of a path; none for one that is not described.

    Of two templates that fit, as `/x/{version}` and `/x/freeze`, the one with fewer parameters is
    meant.

    Parameters
    ----------
    paths
        Operations by template and method, as an OpenAPI document has them.
    """
    asked = path.split("/")
    fitting = [template for template in paths if _fits(template.split("/"), asked)]
    if not fitting:
        return []
    closest = min(fitting, key=lambda template: template.count("{"))
    return [method.upper() for method in METHODS if method in paths[closest]]


def _fits(template: list[str], asked: list[str]) -> bool:
    return len(template) == len(asked) and all(
        part.startswith("{") or part == given for part, given in zip(template, asked, strict=True)
    )
