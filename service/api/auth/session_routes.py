"""Logging in and out, one's own password, and the very first account."""

from contextlib import suppress

from fastapi import APIRouter, Request, Response

from service.api.auth.credentials import COOKIE, PLAIN_COOKIE, Kind
from service.api.auth.declared import OPEN, Reach, needs
from service.api.auth.desk import AccessDesk, Caller
from service.api.auth.doors import LoggedIn, NotLoggedIn
from service.api.auth.gate import caller_of, identity_of
from service.api.auth.mistakes import told_as_problems
from service.api.auth.refused_requests import must_wait, not_let_in
from service.api.auth.session_models import LoginModel, NewPasswordModel, SessionModel, SetUpModel
from service.api.auth.told import BEGUN, ENDED, tell
from service.api.auth.views import session_model
from service.api.context import Context
from service.api.problems import ProblemError, described_problems
from service.store.access.identities import Identity, Means, Permission
from service.store.port import StoreError

LOGIN_PROBLEMS = described_problems(
    {
        401: "The name or the password is wrong",
        403: "Asked for by a page of another site",
        422: "A wrong parameter",
        429: "Too many logins went wrong; Retry-After says how long to wait",
        503: "The store cannot be used, or too many log in at the same time",
    }
)

PASSWORD_PROBLEMS = {
    **LOGIN_PROBLEMS,
    **described_problems({409: "Who asks has no password: a key, or somebody without a login"}),
}

SET_UP_PROBLEMS = described_problems(
    {
        403: "The token is wrong or has been used, or there is an account already",
        422: "A wrong parameter, or a name or password that is not accepted",
        503: "The store cannot be used",
    }
)


def session_router(context: Context, desk: AccessDesk) -> APIRouter:
    """Routes by which people come in and go."""
    router = APIRouter(prefix="/api/v1", tags=["access"])

    @router.get("/session", summary="Who asks", dependencies=[OPEN])
    async def session(request: Request) -> SessionModel:
        """Whether a login is needed, whose this is, and what that may do."""
        return await session_model(caller_of(request), desk)

    @router.post(
        "/session",
        summary="Log in",
        status_code=201,
        responses=LOGIN_PROBLEMS,
        dependencies=[OPEN],
    )
    async def log_in(request: Request, response: Response, asked: LoginModel) -> SessionModel:
        """Begin a session, kept in a cookie; a session that the browser had before ends."""
        let_in = await _let_in(desk, request, asked.name, asked.password)
        await _end(desk, caller_of(request))
        await _tell_begun(context, desk, let_in)
        return await _begun(desk, request, response, let_in)

    @router.delete("/session", summary="Log out", status_code=204, dependencies=[OPEN])
    async def log_out(request: Request, response: Response) -> None:
        """End the session; where there is none nothing happens."""
        caller = caller_of(request)
        await _end(desk, caller)
        if caller.identity is not None and caller.identity.means is Means.SESSION:
            await tell(context.store.audit, context.clock, ENDED, caller.identity.name)
        response.delete_cookie(COOKIE, secure=True, httponly=True, samesite="strict")
        response.delete_cookie(PLAIN_COOKIE, httponly=True, samesite="strict")

    @router.post(
        "/session/password",
        summary="Change one's own password",
        status_code=201,
        responses=PASSWORD_PROBLEMS,
        dependencies=[needs(Permission.READ, Reach.NO_UNIT)],
    )
    async def change_password(
        request: Request, response: Response, asked: NewPasswordModel
    ) -> SessionModel:
        """Set another password; all sessions of the account end, and this browser has a new one."""
        identity = _person(identity_of(request))
        await _let_in(desk, request, identity.name, asked.password)
        with told_as_problems("new_password"):
            await desk.registry.set_password(identity.name, asked.new_password, must_change=False)
        let_in = await _let_in(desk, request, identity.name, asked.new_password)
        await _tell_begun(context, desk, let_in)
        return await _begun(desk, request, response, let_in)

    @router.post(
        "/set-up",
        summary="Make the first account",
        status_code=201,
        responses=SET_UP_PROBLEMS,
        dependencies=[OPEN],
    )
    async def set_up(request: Request, asked: SetUpModel) -> SessionModel:
        """Make the first account, an admin, with the token that the service printed."""
        with told_as_problems():
            is_made = await desk.set_up(asked.token, asked.name, asked.password)
        if not is_made:
            detail = "the token is wrong or used up, or there is an account already"
            raise ProblemError(403, "Not set up", detail)
        return await session_model(caller_of(request), desk)

    return router


async def _let_in(desk: AccessDesk, request: Request, name: str, password: str) -> LoggedIn:
    peer = request.client.host if request.client else ""
    with told_as_problems():
        found = await desk.log_in(name, password, peer)
    if isinstance(found, NotLoggedIn):
        raise must_wait(found.wait_s) if found.wait_s else not_let_in()
    return found


async def _tell_begun(context: Context, desk: AccessDesk, let_in: LoggedIn) -> None:
    """Write a login down; one that cannot be written down is ended."""
    try:
        await tell(context.store.audit, context.clock, BEGUN, let_in.identity.name)
    except StoreError:
        with suppress(StoreError):
            await desk.log_out(let_in.token)
        raise


async def _begun(
    desk: AccessDesk, request: Request, response: Response, let_in: LoggedIn
) -> SessionModel:
    is_secure = _is_secure(request)
    name = COOKIE if is_secure else PLAIN_COOKIE
    response.set_cookie(name, let_in.token, secure=is_secure, httponly=True, samesite="strict")
    caller = caller_of(request)
    return await session_model(Caller(let_in.identity, caller.shown, caller.must_log_in), desk)


def _is_secure(request: Request) -> bool:
    """Whether the browser is at https; a proxy may pass that on as http."""
    return "https" in (request.url.scheme, request.headers.get("origin", "").partition(":")[0])


async def _end(desk: AccessDesk, caller: Caller) -> None:
    if caller.shown.kind is Kind.SESSION:
        await desk.log_out(caller.shown.secret)


def _person(identity: Identity) -> Identity:
    if identity.means is not Means.SESSION:
        raise ProblemError(409, "No password", "who asks has no password here: log in first")
    return identity
