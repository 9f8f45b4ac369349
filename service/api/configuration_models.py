"""What the API answers about the configuration."""

from typing import Annotated, Any

from pydantic import Field

from service.api.models import ApiModel


class ConfigurationModel(ApiModel):
    """The plant file as it was read, with its defaults filled in and its secrets left out."""

    version: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", examples=["9f86d081" * 8])]
    """SHA-256 of the configuration; evidence of alarms names it."""

    padwatch: Annotated[str, Field(examples=["0.1.0"])]
    """Version of the program."""

    commit: str | None
    """What that was built from; null where it is not known."""

    json_schema: Annotated[str, Field(examples=["/api/v1/configuration/schema"])]
    """Where the meaning, limits and default of every key are."""

    settings: dict[str, Any]
    """All settings, by the keys of the plant file."""
