"""Routes for administrators: accounts of persons and API keys of machines."""

from typing import Annotated, Literal

from fastapi import Depends, Path, Request
from pydantic import FailFast, Field

from service.api.auth.authenticator import Authenticator
from service.api.auth.gate import GuardedRouter, Reach, identity_of, name_caller, subject_router
from service.api.auth.passwords import MAX_LENGTH
from service.api.context import Context
from service.api.problems import ProblemError, problem_responses
from service.api.values import ApiModel, RequestModel, Time
from service.store.access.identities import MAX_DAYS, MAX_NAME, Means, Permission, Role

RoleName = Literal["viewer", "operator", "engineer", "admin"]

LoginName = Annotated[
    str,
    Field(
        max_length=4 * MAX_NAME,
        description="Name of the characters a-z 0-9 . _ @ -; not case-sensitive.",
        examples=["anna"],
    ),
]

Password = Annotated[
    str,
    Field(
        max_length=4 * MAX_LENGTH,
        description="Password of 12 to 256 characters, at least 6 of them different.",
        examples=["a long and unusual sentence"],
    ),
]

UnitName = Annotated[str, Field(max_length=32, examples=["U1"])]


class AccountModel(ApiModel):
    """Account of a person."""

    role: Annotated[RoleName, Field(examples=["operator"])]
    created: Time

    name: Annotated[str, Field(examples=["anna"])]
    """Login name."""

    password_set: Annotated[Time, Field(validation_alias="password_ns")]
    """Time when the password was last set."""


class NewAccountModel(RequestModel):
    """Request to add an account of a person."""

    role: Annotated[RoleName, Field(examples=["operator"])]
    name: LoginName
    password: Password


class SetRoleModel(RequestModel):
    """Request to change the role of an account."""

    role: Annotated[RoleName, Field(examples=["engineer"])]


class SetPasswordModel(RequestModel):
    """Request to set the password of an account."""

    password: Password


class KeyModel(ApiModel):
    """API key of a machine, without its secret."""

    role: Annotated[RoleName, Field(examples=["viewer"])]
    created: Time

    id: Annotated[str, Field(examples=["5f0c6f3a9b1e"])]
    """Public part of the key, which identifies it."""

    name: Annotated[str, Field(examples=["historian"])]
    """Name of the key, such as that of the machine."""

    units: Annotated[list[str], Field(examples=[["U1", "U2"]])]
    """Units for which the key is valid; empty if it is valid for all units."""

    state: Literal["valid", "expired", "revoked"]
    """State of the key."""

    expires: Time
    """Time of expiry of the key."""

    used: Time | None
    """Time of last use, accurate to a minute; null if the key was never used."""

    revoked: Time | None
    """Time of revocation; null if the key is not revoked."""


class NewKeyModel(RequestModel):
    """Request to create an API key for a machine."""

    role: Annotated[RoleName, Field(examples=["viewer"])]
    name: LoginName

    units: Annotated[list[UnitName], FailFast(), Field(max_length=200, default_factory=list)]
    """Units for which the key is valid; empty if it is valid for all units."""

    days: Annotated[int, Field(ge=1, le=MAX_DAYS, examples=[365])] = 365
    """Validity period from creation, days."""


class CreatedKeyModel(KeyModel):
    """New API key, with its secret."""

    key: Annotated[str, Field(examples=["pw_5f0c6f3a9b1e_…"])]
    """Complete key with its secret, which is not stored and cannot be read again."""


AccountName = Annotated[
    str, Path(description="Name of an account.", max_length=256, examples=["anna"])
]

NEW_PROBLEMS = problem_responses(
    own={422: "A wrong parameter, or a name or password that is not accepted"}
)
CHANGE_PROBLEMS = NEW_PROBLEMS | problem_responses(409, own={404: "Unknown account or key"})

KeyId = Annotated[
    str, Path(description="Public part of a key.", max_length=64, examples=["5f0c6f3a9b1e"])
]


def access_router(context: Context, authenticator: Authenticator) -> GuardedRouter:
    """Return the router for accounts and API keys."""
    store, now_ns = authenticator.store, authenticator.clock.now_ns
    change = authenticator.change
    router = subject_router("", "access", Permission.CHANGE_ACCESS, Reach.NO_UNIT)
    router.dependencies.append(Depends(name_caller))

    async def one(name: str) -> AccountModel:
        found = await authenticator.run(lambda: store.accounts.get(name))
        if found is None:
            raise ProblemError(404, "Unknown account", "the account does not exist")
        return AccountModel.of(found)

    @router.get("/accounts")
    async def accounts() -> list[AccountModel]:
        """List all accounts, sorted by name."""
        return [AccountModel.of(account) for account in await authenticator.run(store.accounts.all)]

    @router.post("/accounts", status_code=201, responses=CHANGE_PROBLEMS)
    async def add_account(asked: NewAccountModel) -> AccountModel:
        """Add an account; its password must be changed at the first login."""
        new, add = (asked.name, Role(asked.role), asked.password), authenticator.add
        return await one(await change(lambda: add(*new, must_change=True), hashes=True))

    @router.put("/accounts/{name}/role", responses=CHANGE_PROBLEMS)
    async def set_role(name: AccountName, asked: SetRoleModel) -> AccountModel:
        """Change the role of an account, effective from the next request of the person."""
        await change(lambda: store.accounts.set_role(name, Role(asked.role), now_ns()))
        return await one(name)

    @router.put("/accounts/{name}/password", responses=CHANGE_PROBLEMS)
    async def set_password(
        request: Request, name: AccountName, asked: SetPasswordModel
    ) -> AccountModel:
        """Set the password of another person's account, and end the sessions of the account.

        The person must change this password at the next login.
        """
        _require_other(request, name, "use POST /session/password to change your own password")
        await one(name)  # before hashing, which is slow
        new, set_new = (name, asked.password), authenticator.set_password
        await change(lambda: set_new(*new, must_change=True), hashes=True)
        return await one(name)

    @router.delete("/accounts/{name}", status_code=204, responses=CHANGE_PROBLEMS)
    async def remove_account(request: Request, name: AccountName) -> None:
        """Remove the account of another person, and end the sessions of the account."""
        _require_other(request, name, "you cannot remove your own account")
        await change(lambda: store.accounts.remove(name, now_ns()))

    @router.get("/keys")
    async def keys() -> list[KeyModel]:
        """List all API keys, also expired and revoked keys, oldest first, without their secrets."""
        found, time_ns = await authenticator.run(store.keys.all), now_ns()
        return [KeyModel.of(key, state=key.state(time_ns)) for key in found]

    @router.post("/keys", status_code=201, responses=CHANGE_PROBLEMS)
    async def create_key(asked: NewKeyModel) -> CreatedKeyModel:
        """Create an API key for a machine; only this answer contains the secret of the key."""
        for unit in asked.units:
            if unit not in context.units:
                detail = f"unknown unit {unit!r}; known units: {', '.join(context.units)}"
                raise ProblemError(422, "Wrong parameter", detail, "units")
        new = asked.name, Role(asked.role), asked.units, asked.days
        made, shown = await change(lambda: authenticator.create_key(*new))
        return CreatedKeyModel.of(made, state=made.state(made.created_ns), key=shown)

    @router.delete("/keys/{key}", status_code=204, responses=CHANGE_PROBLEMS)
    async def revoke_key(key: KeyId) -> None:
        """Revoke an API key permanently; the request is idempotent."""
        if await authenticator.run(lambda: store.keys.get(key)) is None:
            raise ProblemError(404, "Unknown key", "the key does not exist")
        await change(lambda: store.keys.revoke(key, now_ns()))

    return router


def _require_other(request: Request, name: str, detail: str) -> None:
    """Raise a problem of status 409 if the caller has logged in with the account `name`."""
    identity = identity_of(request)
    if identity.means is Means.SESSION and identity.name == name:
        raise ProblemError(409, "Conflict", detail)
