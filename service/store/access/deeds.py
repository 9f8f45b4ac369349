"""What is told of changes of accounts and keys; never a password, a key or a digest."""

from service.store.access.acting import acting
from service.store.access.audit_entry import Deed, Document
from service.store.access.keys import ApiKey
from service.store.access.roles import Role


def account_deed(
    done: str, name: str, now_ns: int, before: Role | None = None, after: Role | None = None
) -> Deed:
    """Something that has been done to an account, with its role before and after."""
    return _deed(f"account.{done}", name, now_ns, _role(before), _role(after))


def key_deed(done: str, id_: str, now_ns: int, made: ApiKey | None = None) -> Deed:
    """Something that has been done to a key, with what it opens if it is new."""
    after = None
    if made is not None:
        after = {
            "name": made.name,
            "role": made.role.value,
            "units": list(made.units),
            "expires_ns": made.expires_ns,
        }
    return _deed(f"key.{done}", id_, now_ns, None, after)


def _role(role: Role | None) -> Document:
    return None if role is None else {"role": role.value}


def _deed(action: str, object_: str, now_ns: int, before: Document, after: Document) -> Deed:
    who = acting()
    return Deed(now_ns, who.actor, action, object_, before, after, source=who.source, peer=who.peer)
