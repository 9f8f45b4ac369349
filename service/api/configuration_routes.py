"""The configuration, to be read."""

import json
from typing import Any

from fastapi import APIRouter, Response

from service.api.auth.declared import Reach, needs
from service.api.configuration_models import ConfigurationModel
from service.api.context import Context
from service.api.problems import ProblemError, described_problems
from service.settings.loading import plant_file_schema
from service.store.access.identities import Permission

SCHEMA = "/api/v1/configuration/schema"

SCHEMA_TYPE = "application/schema+json"

ABSENT = described_problems({404: "The service keeps no configuration"})


def configuration_router(context: Context) -> APIRouter:
    """Routes that show the configuration; they change nothing."""
    router = APIRouter(
        prefix="/api/v1/configuration", tags=["plant"], dependencies=[needs(Permission.READ)]
    )

    @router.get("", summary="Configuration", responses=ABSENT)
    async def configuration() -> ConfigurationModel:
        """The plant file as it was read when the service started, without its secrets.

        Its version is the one that evidence of alarms names.
        """
        if context.configuration is None:
            raise ProblemError(404, "No configuration", "no configuration is kept here")
        found = context.configuration
        document = json.loads(found.text)
        return ConfigurationModel(
            version=found.version,
            padwatch=document["padwatch"],
            commit=document["commit"],
            json_schema=SCHEMA,
            settings=document["settings"],
        )

    @router.get(
        "/schema",
        dependencies=[needs(Permission.READ, Reach.NO_UNIT)],
        summary="JSON schema of plant files",
        response_class=Response,
        responses={200: _schema_content()},
    )
    async def schema() -> Response:
        """Meaning, limits and default of every key of a plant file, as a JSON schema."""
        return Response(json.dumps(plant_file_schema()), media_type=SCHEMA_TYPE)

    return router


def _schema_content() -> dict[str, Any]:
    schema = {"type": "object", "examples": [{"title": "PlantFile", "type": "object"}]}
    return {"description": "A JSON schema", "content": {SCHEMA_TYPE: {"schema": schema}}}
