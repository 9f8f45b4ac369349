"""What is said and asked about logins."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.auth.passwords import MAX_LENGTH
from service.api.models import ApiModel, RequestModel
from service.store.access.identities import MAX_NAME

RoleName = Literal["viewer", "operator", "engineer", "admin"]

PermissionName = Literal["read", "act_on_alarms", "change_measuring", "read_audit", "change_access"]


LoginName = Annotated[str, Field(max_length=4 * MAX_NAME, examples=["anna"])]
Password = Annotated[
    str, Field(max_length=4 * MAX_LENGTH, examples=["a sentence that nobody guesses"])
]


class SessionModel(ApiModel):
    """Who asks, and what he may do."""

    login_required: bool
    """Whether one must log in to see the plant from where this is asked; to change anything one
    must everywhere, but in the demonstration."""

    set_up_needed: bool
    """Whether there is no account yet that one could log in to."""

    password_change_needed: bool
    """Whether nothing is open before the password is changed, which somebody else has set."""

    name: Annotated[str | None, Field(examples=["anna"])]
    """Name of the account or key; null for nobody in particular."""

    role: Annotated[RoleName | None, Field(examples=["operator"])]
    """What that is to the plant; null where one must log in first. Who has not logged in on this
    computer is a viewer."""

    permissions: Annotated[list[PermissionName], Field(examples=[["read", "act_on_alarms"]])]
    """What that may do; nothing where one must log in first."""


class LoginModel(RequestModel):
    """Somebody wants to log in."""

    name: LoginName
    """Name of the account; upper and lower case are the same."""

    password: Password
    """Its password."""


class NewPasswordModel(RequestModel):
    """Somebody changes his own password."""

    password: Password
    """The password until now."""

    new_password: Password
    """The one from now on: 12 to 256 characters, at least 6 different ones."""


class SetUpModel(RequestModel):
    """Somebody makes the first account."""

    token: Annotated[str, Field(max_length=256, examples=["the token that the service printed"])]
    """The token that the service printed when it started."""

    name: LoginName
    """Name of the account: a-z 0-9 . _ @ -."""

    password: Password
    """Its password: 12 to 256 characters, at least 6 different ones."""
