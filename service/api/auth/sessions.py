"""Routes for login, logout, password change, and creation of the first account."""

from dataclasses import replace
from typing import Annotated

from fastapi import Request, Response
from pydantic import Field

from service.api.auth.accounts import NEW_PROBLEMS, LoginName, Password, RoleName
from service.api.auth.authenticator import Authenticator, LoggedIn, tidy_name
from service.api.auth.credentials import COOKIE, PLAIN_COOKIE, Caller
from service.api.auth.gate import OPEN, GuardedRouter, Reach, caller_of, identity_of, needs
from service.api.auth.passwords import PasswordRefusedError
from service.api.problems import ProblemError, problem_responses
from service.api.values import ApiModel, RequestModel
from service.store.access.audit_entries import acting
from service.store.access.identities import Means, Permission, Role


class SessionModel(ApiModel):
    """Identity and permissions of the caller, and whether a login is required."""

    login_required: bool
    """Whether this client must log in to read data; changes always require a login, except in the
    demonstration."""

    set_up_needed: bool
    """Whether no account exists, so that the first account must be created."""

    password_change_needed: bool
    """Whether the caller must change the password, because an administrator has set it."""

    name: Annotated[str | None, Field(examples=["anna"])]
    """Name of the account or key; null without a login."""

    role: Annotated[RoleName | None, Field(examples=["operator"])]
    """Role of the caller; null if the caller must log in first."""

    permissions: Annotated[list[Permission], Field(examples=[["read", "act_on_alarms"]])]
    """Permissions of the caller; empty if the caller must log in first."""


class LoginModel(RequestModel):
    """Request to log in."""

    name: LoginName
    password: Password


class NewPasswordModel(RequestModel):
    """Request to change the password of the caller."""

    new_password: Password

    password: Password
    """Current password."""


class SetUpModel(LoginModel):
    """Request to create the first account."""

    token: Annotated[str, Field(max_length=256, examples=["the token that the service printed"])]
    """Set-up token that the service printed when it started."""


LOGIN_PROBLEMS = problem_responses(
    403,
    own={
        401: "The name or the password is wrong",
        429: "Too many failed logins; Retry-After gives the wait",
        503: "The store cannot be used, or too many concurrent logins",
    },
)

PASSWORD_PROBLEMS = LOGIN_PROBLEMS | problem_responses(own={409: "The caller has no password"})

SET_UP_PROBLEMS = NEW_PROBLEMS | problem_responses(
    503, own={403: "The token is wrong or has been used, or there is an account already"}
)


def session_router(authenticator: Authenticator) -> GuardedRouter:
    """Return the router for sessions and for the creation of the first account."""
    router = GuardedRouter(prefix="/api/v1", tags=["access"])

    async def session_model(caller: Caller) -> SessionModel:
        identity = caller.identity
        may_all = identity is not None and (identity.is_proven or identity.role is Role.ADMIN)
        accounts = authenticator.store.accounts
        return SessionModel(
            login_required=caller.must_log_in,
            set_up_needed=not may_all and not await authenticator.run(accounts.all),
            password_change_needed=identity is not None and identity.must_change_password,
            name=identity.name if identity is not None and identity.is_proven else None,
            role=identity.role.value if identity is not None else None,
            permissions=[p for p in Permission if identity is not None and identity.role.may(p)],
        )

    async def begun(request: Request, response: Response, logged_in: LoggedIn) -> SessionModel:
        # the browser may use HTTPS although a proxy forwards its requests over HTTP
        scheme = request.headers.get("origin", "").partition(":")[0]
        secure = "https" in (request.url.scheme, scheme)
        name, token = COOKIE if secure else PLAIN_COOKIE, logged_in.token
        response.set_cookie(name, token, secure=secure, httponly=True, samesite="strict")
        return await session_model(replace(caller_of(request), identity=logged_in.identity))

    @router.get("/session", dependencies=[OPEN])
    async def current_identity(request: Request) -> SessionModel:
        """Return identity and permissions of the caller, and whether a login is required."""
        return await session_model(caller_of(request))

    @router.post("/session", status_code=201, responses=LOGIN_PROBLEMS, dependencies=[OPEN])
    async def log_in(request: Request, response: Response, asked: LoginModel) -> SessionModel:
        """Log in: start a session and set its cookie; an earlier session of the browser ends."""
        peer, caller = acting().peer or "", caller_of(request)
        logged_in = await authenticator.run_hashing(
            lambda: authenticator.log_in(asked.name, asked.password, peer),
            is_known=authenticator.backoff.knows(tidy_name(asked.name), peer),
        )
        if caller.means is Means.SESSION:
            await authenticator.log_out(caller.secret, is_replaced=True)
        return await begun(request, response, logged_in)

    @router.delete("/session", status_code=204, dependencies=[OPEN])
    async def log_out(request: Request, response: Response) -> None:
        """Log out: end the session of the browser, if any, and delete the session cookie."""
        caller = caller_of(request)
        if caller.means is Means.SESSION:
            await authenticator.log_out(caller.secret)
        response.delete_cookie(COOKIE, secure=True, httponly=True, samesite="strict")
        response.delete_cookie(PLAIN_COOKIE, httponly=True, samesite="strict")

    @router.post(
        "/session/password",
        status_code=201,
        responses=PASSWORD_PROBLEMS,
        dependencies=[needs(Permission.READ, Reach.NO_UNIT)],
    )
    async def change_password(
        request: Request, response: Response, asked: NewPasswordModel
    ) -> SessionModel:
        """Change the password of the caller; all earlier sessions end, and a new one starts."""
        identity = identity_of(request)
        if identity.means is not Means.SESSION:
            detail = "this identity has no password; log in with an account first"
            raise ProblemError(409, "No password", detail)
        given = identity.name, asked.password, asked.new_password, acting().peer or ""
        change = authenticator.change_password
        try:
            logged_in = await authenticator.change(lambda: change(*given), hashes=True)
        except PasswordRefusedError as error:
            raise ProblemError(422, "Wrong parameter", str(error), "new_password") from error
        return await begun(request, response, logged_in)

    @router.post("/set-up", status_code=201, responses=SET_UP_PROBLEMS, dependencies=[OPEN])
    async def create_first_account(request: Request, asked: SetUpModel) -> SessionModel:
        """Create the first account, an administrator, with the token that the service printed."""
        given, set_up = (asked.token, asked.name, asked.password), authenticator.set_up
        if not await authenticator.run_hashing(lambda: set_up(*given), is_known=False):
            detail = "the token is wrong or was used, or an account exists already"
            raise ProblemError(403, "Setup rejected", detail)
        return await session_model(caller_of(request))

    return router
