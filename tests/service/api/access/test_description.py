"""The published description is made once, in a thread, while clients are served already."""

import json
from concurrent.futures import ThreadPoolExecutor
from typing import Any


def test_whoever_asks_for_the_description_while_it_is_made_gets_all_of_it(access: Any) -> None:
    whole = json.dumps(access.app.openapi())
    access.app.openapi_schema = None
    with ThreadPoolExecutor(4) as threads:
        asked = [threads.submit(lambda: json.dumps(access.app.openapi())) for _ in range(4)]
    assert {each.result() for each in asked} == {whole}
