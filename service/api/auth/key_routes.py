"""Keys of machines, for admins."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path

from service.api.auth.account_models import CreatedKeyModel, KeyModel, NewKeyModel
from service.api.auth.actors import name_whoever_asks
from service.api.auth.declared import Reach, needs
from service.api.auth.mistakes import told_as_problems
from service.api.auth.registry import AccessRegistry
from service.api.auth.views import key_model
from service.api.context import Context
from service.api.problems import ProblemError, described_problems
from service.store.access.identities import Permission, Role

KeyId = Annotated[
    str, Path(description="Public part of a key.", max_length=64, examples=["5f0c6f3a9b1e"])
]

READ_PROBLEMS = described_problems({503: "The store cannot be read"})

CHANGE_PROBLEMS = described_problems(
    {
        403: "Not allowed, or asked for by a page of another site",
        404: "Unknown key",
        409: "No such key can be made",
        422: "A wrong parameter, or a name that is not accepted",
        503: "Not stored",
    }
)


def key_router(context: Context, registry: AccessRegistry) -> APIRouter:
    """Routes about keys."""
    router = APIRouter(
        prefix="/api/v1/keys",
        tags=["access"],
        dependencies=[
            needs(Permission.CHANGE_ACCESS, Reach.NO_UNIT),
            Depends(name_whoever_asks),
        ],
    )

    @router.get("", summary="Keys", responses=READ_PROBLEMS)
    async def keys() -> list[KeyModel]:
        """All keys that ever were, oldest first; what they open is in them alone."""
        now_ns = context.clock.now_ns()
        return [KeyModel.model_validate(key_model(key, now_ns)) for key in await registry.keys()]

    @router.post("", summary="Create a key", status_code=201, responses=CHANGE_PROBLEMS)
    async def create(asked: NewKeyModel) -> CreatedKeyModel:
        """Make a key for a machine and show it: this once, nobody can show it again."""
        for unit in asked.units:
            if unit not in context.units:
                detail = "there is no such unit in this plant"
                raise ProblemError(422, "Wrong parameter", detail, "units")
        with told_as_problems():
            made, shown = await registry.create_key(
                asked.name, Role(asked.role), asked.units, asked.days
            )
        about = key_model(made, context.clock.now_ns())
        return CreatedKeyModel.model_validate({**about, "key": shown})

    @router.delete("/{key}", summary="Revoke a key", status_code=204, responses=CHANGE_PROBLEMS)
    async def revoke(key: KeyId) -> None:
        """Take a key back for ever, from its next request on; doing so twice changes nothing."""
        if not await registry.revoke_key(key):
            raise ProblemError(404, "Unknown key", "there is no such key")

    return router
