"""Every answer says whether it is about now or about a recording."""

from typing import Any


async def test_every_answer_carries_its_origin_errors_and_pages_included(read_only: Any) -> None:
    for path in ("/api/v1/overview", "/api/v1/units/U9", "/livez", "/", "/nothing"):
        response = await read_only.get(path)
        assert response.headers["padwatch-origin"] == "live", path
