"""Accounts of people, for admins."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path, Request

from service.api.auth.account_models import (
    AccountModel,
    NewAccountModel,
    SetPasswordModel,
    SetRoleModel,
)
from service.api.auth.actors import name_whoever_asks
from service.api.auth.declared import Reach, needs
from service.api.auth.gate import identity_of
from service.api.auth.mistakes import told_as_problems
from service.api.auth.registry import AccessRegistry
from service.api.auth.views import account_model
from service.api.problems import ProblemError, described_problems
from service.store.access.identities import Means, Permission, Role

AccountName = Annotated[
    str, Path(description="Name of an account.", max_length=256, examples=["anna"])
]

READ_PROBLEMS = described_problems({503: "The store cannot be read"})

CHANGE_PROBLEMS = described_problems(
    {
        403: "Not allowed, or asked for by a page of another site",
        404: "Unknown account",
        409: "Does not fit the accounts as they are now",
        422: "A wrong parameter, or a name or password that is not accepted",
        503: "Not stored",
    }
)


def account_router(registry: AccessRegistry) -> APIRouter:
    """Routes about accounts."""
    router = APIRouter(
        prefix="/api/v1/accounts",
        tags=["access"],
        dependencies=[
            needs(Permission.CHANGE_ACCESS, Reach.NO_UNIT),
            Depends(name_whoever_asks),
        ],
    )

    @router.get("", summary="Accounts", responses=READ_PROBLEMS)
    async def accounts() -> list[AccountModel]:
        """All accounts, by name."""
        return [account_model(account) for account in await registry.accounts()]

    @router.post("", summary="Add an account", status_code=201, responses=CHANGE_PROBLEMS)
    async def add(asked: NewAccountModel) -> AccountModel:
        """Give somebody an account, with a password to change at the first login."""
        with told_as_problems():
            name = await registry.add(asked.name, Role(asked.role), asked.password)
        return await _one(registry, name)

    @router.put("/{name}/role", summary="Change a role", responses=CHANGE_PROBLEMS)
    async def set_role(name: AccountName, asked: SetRoleModel) -> AccountModel:
        """Change what an account is to the plant, from its next request on."""
        await _one(registry, name)
        with told_as_problems():
            await registry.set_role(name, Role(asked.role))
        return await _one(registry, name)

    @router.put("/{name}/password", summary="Set a password", responses=CHANGE_PROBLEMS)
    async def set_password(
        request: Request, name: AccountName, asked: SetPasswordModel
    ) -> AccountModel:
        """Set somebody else's password, to be changed at the next login; all sessions end."""
        if _is_own(request, name):
            detail = "one's own password is changed with the present one: POST /session/password"
            raise ProblemError(409, "Does not fit", detail)
        await _one(registry, name)
        with told_as_problems():
            await registry.set_password(name, asked.password, must_change=True)
        return await _one(registry, name)

    @router.delete(
        "/{name}", summary="Remove an account", status_code=204, responses=CHANGE_PROBLEMS
    )
    async def remove(request: Request, name: AccountName) -> None:
        """Remove an account, and log out who is logged in to it; nobody removes his own."""
        if _is_own(request, name):
            raise ProblemError(409, "Does not fit", "nobody removes his own account")
        await _one(registry, name)
        with told_as_problems():
            await registry.remove(name)

    return router


def _is_own(request: Request, name: str) -> bool:
    """Whether somebody asks about the account that he is logged in to."""
    identity = identity_of(request)
    return identity.means is Means.SESSION and identity.name == name


async def _one(registry: AccessRegistry, name: str) -> AccountModel:
    found = await registry.account(name)
    if found is None:
        raise ProblemError(404, "Unknown account", "there is no such account")
    return account_model(found)
