"""What is said and asked about accounts and keys."""

from typing import Annotated, Literal

from pydantic import FailFast, Field

from service.api.auth.session_models import LoginName, Password, RoleName
from service.api.models import ApiModel, RequestModel, Time
from service.store.access.identities import MAX_DAYS

UnitName = Annotated[str, Field(max_length=32, examples=["U1"])]


class AccountModel(ApiModel):
    """An account of a person."""

    name: Annotated[str, Field(examples=["anna"])]
    """Name that one logs in with."""

    role: Annotated[RoleName, Field(examples=["operator"])]
    """What the account is to the plant."""

    created: Time
    """When it was added."""

    password_set: Time
    """When its password was set."""


class NewAccountModel(RequestModel):
    """Somebody is to get an account."""

    name: LoginName
    """Name of the account: a-z 0-9 . _ @ -."""

    role: Annotated[RoleName, Field(examples=["operator"])]
    """What the account is to the plant."""

    password: Password
    """Its first password: 12 to 256 characters, at least 6 different ones."""


class SetRoleModel(RequestModel):
    """An account is to become something else to the plant."""

    role: Annotated[RoleName, Field(examples=["engineer"])]
    """What the account is from its next request on."""


class SetPasswordModel(RequestModel):
    """An account is to get another password."""

    password: Password
    """The new password: 12 to 256 characters, at least 6 different ones."""


class KeyModel(ApiModel):
    """A key of a machine, without what opens anything."""

    id: Annotated[str, Field(examples=["5f0c6f3a9b1e"])]
    """Public part of the key."""

    name: Annotated[str, Field(examples=["historian"])]
    """What it is for."""

    role: Annotated[RoleName, Field(examples=["viewer"])]
    """What the machine is to the plant."""

    units: Annotated[list[str], Field(examples=[["U1", "U2"]])]
    """The only units that it opens; empty for all."""

    state: Literal["valid", "expired", "revoked"]
    """Whether it opens anything."""

    created: Time
    """When it was made."""

    expires: Time
    """When it ends."""

    used: Time | None
    """When it was used last, to a minute; null if it never was."""

    revoked: Time | None
    """When it was taken back; null if it was not."""


class NewKeyModel(RequestModel):
    """A machine is to get a key."""

    name: LoginName
    """What it is for: a-z 0-9 . _ @ -."""

    role: Annotated[RoleName, Field(examples=["viewer"])]
    """What the machine is to the plant."""

    units: Annotated[list[UnitName], FailFast(), Field(max_length=200, default_factory=list)]
    """The only units that it is to open; empty for all."""

    days: Annotated[int, Field(ge=1, le=MAX_DAYS, examples=[365])] = 365
    """For how many days it is valid."""


class CreatedKeyModel(KeyModel):
    """A key that has just been made."""

    key: Annotated[str, Field(examples=["pw_5f0c6f3a9b1e_…"])]
    """The key itself: shown this once, stored nowhere."""
