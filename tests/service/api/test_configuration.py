"""What the API says of the configuration: all of it but the secrets."""

import json
from typing import Any

from service.evidence.configuration import Configuration
from service.settings.schema import plant_file_schema


async def test_the_configuration_is_the_plant_file_under_the_version_of_its_evidence(
    read_only: Any,
) -> None:
    body = await read_only.json("/api/v1/configuration")

    settings = body["settings"]
    assert settings["plant"] == {"name": "Demo plant"}
    assert [unit["id"] for unit in settings["unit"]] == ["U1", "U2"]
    document = {
        "format": "padwatch-configuration",
        "version": 1,
        "padwatch": body["padwatch"],
        "commit": body["commit"],
        "settings": settings,
    }
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert body["version"] == Configuration(text.encode()).version
    meaning = await read_only.get(body["json_schema"])
    assert meaning.headers["content-type"] == "application/schema+json"
    assert meaning.json() == plant_file_schema()
