"""A method that a path does not have is refused with those that it has."""

import pytest

from service.api.methods import allowed_methods

PATHS = {
    "/x": {"get": {}, "post": {}, "parameters": []},
    "/x/{version}": {"get": {}},
    "/x/freeze": {"post": {}},
    "/x/{version}/y": {"delete": {}},
}


@pytest.mark.parametrize(
    ("path", "methods"),
    [
        ("/x", ["GET", "POST"]),
        ("/x/3", ["GET"]),
        ("/x/freeze", ["POST"]),
        ("/x/freeze/y", ["DELETE"]),
        ("/x/", ["GET"]),
        ("/y", []),
    ],
)
def test_the_closest_operation_says_which_methods_there_are(path: str, methods: list[str]) -> None:
    assert allowed_methods(PATHS, path) == methods
