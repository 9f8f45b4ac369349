"""Messages as mail over SMTP: one recipient, one connection, one answer that counts."""

import asyncio
import contextlib
import math
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from email.message import EmailMessage
from email.policy import SMTP as SMTP_POLICY

import aiosmtplib

from acquisition.delivery.network import NameLookUp
from service.notifications.channel import (
    PATIENT,
    Delivered,
    Failed,
    Outcome,
    Refused,
    Secret,
    SecretError,
    Timeouts,
    Trust,
    connected_socket,
    printable,
    words,
)
from service.notifications.message import Message
from service.settings.alarm_kinds import kind_words

CHANGES = {"escalated": "rose to danger", "eased": "eased to alert"}

WHOLE_UNIT = ("device", "link")

NOT_A_SYSTEM_OF_PROTECTION = (
    "padwatch is a condition-monitoring service and no protection system: this mail informs."
)


def subject(message: Message) -> str:
    """One line, fit for a header whatever the plant and its parts are called."""
    if message["type"] == "test":
        return printable(f"[padwatch] {message['plant']}: test message")
    priority = (message["priority"] or "").upper() if message["is_active"] else "over"
    words = f"{_place(message)} {kind_words(message['kind'])} {change_words(message)}"
    return printable(f"[padwatch] {message['plant']}: {priority}, {words}")


def text(message: Message) -> str:
    """The whole mail."""
    lines = _test(message) if message["type"] == "test" else _alarm(message)
    return "\n".join(lines) + "\n"


def change_words(message: Message) -> str:
    """What has happened to the alarm."""
    change: str = message["change"]
    return CHANGES.get(change, change.replace("_", " "))


def value_words(message: Message) -> str | None:
    """The value with its uncertainty, and the limit; None where there is no number."""
    value, limit, std = message["value"], message["limit"], message["uncertainty"]
    if value is None:
        return None
    if message["value_is"] == "ln_change":
        return _change(value, limit, std)
    unit = message["value_unit"] or ""
    spread = "" if std is None else f" ± {2 * std:.2g} (95 %)"
    passed = "" if limit is None else f"; limit {limit:g} {unit}"
    return f"{value:.4g}{spread} {unit}{passed}"


def _change(value: float, limit: float | None, std: float | None) -> str:
    """A change of a stiffness in ln, in percent of the baseline."""
    percent = 100.0 * math.expm1(value)
    spread = "" if std is None else f" ± {2 * 100.0 * std * math.exp(value):.1f} (95 %)"
    edge = None if limit is None else 100.0 * math.expm1(math.copysign(limit, value))
    passed = "" if edge is None else f"; limit {edge:+.1f} %"
    return f"{percent:+.1f}{spread} % against the baseline at the same condition{passed}"


def _alarm(message: Message) -> Iterator[str]:
    rows = [
        ("What", f"{kind_words(message['kind'])}: {change_words(message)}"),
        ("Priority", message["priority"]),
        ("Where", f"{message['plant']}, {_place(message)}{_unit_name(message)}"),
        ("When", message["time"]),
        ("Since", message["raised"]),
        ("Value", value_words(message)),
        ("Reason", "" if message["reason"] == "ok" else message["reason"].replace("_", " ")),
        ("By", message["actor"]),
        ("State", message["state"].replace("_", " ")),
        ("Operation", (message["operating_state"] or "").replace("_", " ")),
    ]
    for name, found in rows:
        if found:
            yield f"{name + ':':<11}{printable(str(found), 1000)}"
    for fact in message["condition"].values():
        spread = "" if fact["uncertainty"] is None else f" ± {2 * fact['uncertainty']:.2g} (95 %)"
        unit = "" if fact["unit"] == "1" else f" {fact['unit']}"
        yield f"{fact['label'] + ':':<20} {fact['value']:.4g}{spread}{unit}"
    yield from ("", *_foot(message))


def _test(message: Message) -> Iterator[str]:
    yield f"This is a test message of padwatch at {printable(message['plant'])}."
    yield "Alarms of this plant would arrive here."
    yield from ("", *_foot(message))


def _foot(message: Message) -> Iterator[str]:
    if message["url"]:
        yield f"Dashboard: {message['url']}"
    yield f"Event: {message['id']}"
    yield NOT_A_SYSTEM_OF_PROTECTION


def _place(message: Message) -> str:
    about_part = message["subject"] not in WHOLE_UNIT
    return f"{message['unit']} {message['subject']}" if about_part else str(message["unit"])


def _unit_name(message: Message) -> str:
    return f" ({message['unit_name']})" if message["unit_name"] else ""


QUIT_S = 2.0
"""How long a server that has taken the mail gets to say goodbye."""

LOGIN_CODES = (503, 530, 534, 535, 538)
"""Answers of 5xx that speak of the login and not of the mail."""

POLICY = SMTP_POLICY.clone(cte_type="7bit", max_line_length=76)


@dataclass(frozen=True)
class MailTarget:
    """Which server, and whose mailbox.

    Parameters
    ----------
    tls
        "starttls" (required then), "implicit" or "none".
    username, password
        Both or none.
    """

    host: str
    port: int
    sender: str
    recipient: str
    tls: str = "starttls"
    username: str | None = None
    password: Secret | None = None
    timeouts: Timeouts = PATIENT


class Mail:
    """Carries messages to one mailbox."""

    def __init__(self, target: MailTarget, trust: Trust) -> None:
        self._target, self._trust = target, trust
        self._look_up = NameLookUp(target.host, target.port)

    async def carry(self, message: Message, body: str) -> Outcome:  # noqa: ARG002
        """Try once."""
        target = self._target
        mail = mail_of(message, target.sender, target.recipient).as_bytes()
        try:
            async with asyncio.timeout(target.timeouts.total_s):
                return await self._send(mail)
        except aiosmtplib.SMTPRecipientsRefused as error:
            return _judged(error.recipients[0])
        except (aiosmtplib.SMTPSenderRefused, aiosmtplib.SMTPDataError) as error:
            return _judged(error)
        except aiosmtplib.SMTPResponseException as error:
            return Failed(_said(error))
        except (aiosmtplib.SMTPException, OSError, ValueError, SecretError) as error:
            # what it stands on says why, without the library's words around it
            cause = error.__cause__ if isinstance(error.__cause__, OSError) else error
            return Failed(printable(words(cause)))

    async def _send(self, mail: bytes) -> Outcome:
        target = self._target
        sock = await connected_socket(self._look_up, target.port, target.timeouts.connect_s)
        try:
            server = await self._client(sock)
            try:
                await self._open(server)
                _, answer = await server.sendmail(target.sender, [target.recipient], mail)
                await _part(server)
            finally:
                server.close()
        finally:
            sock.close()
        return Delivered(printable(answer))

    async def _client(self, sock: socket.socket) -> aiosmtplib.SMTP:
        target = self._target
        is_tls = target.tls != "none"
        return aiosmtplib.SMTP(
            hostname=target.host,
            sock=sock,
            local_hostname=printable(socket.gethostname()).replace(" ", "-") or "padwatch",
            timeout=target.timeouts.answer_s,
            use_tls=target.tls == "implicit",
            start_tls=False,  # asked for below, where it is required
            tls_context=await self._trust.context() if is_tls else None,
        )

    async def _open(self, server: aiosmtplib.SMTP) -> None:
        """Connect, encrypt and log in.

        Raises
        ------
        SecretError
            If there is no password; the server is not troubled then.
        """
        target = self._target
        password = target.password.read() if target.password else None
        await server.connect()
        if target.tls == "starttls":
            await server.starttls()
        if target.username is not None and password is not None:
            await server.login(target.username, password)


def mail_of(message: Message, sender: str, recipient: str) -> EmailMessage:
    """A mail that is the same at every attempt, and tells machines that no human wrote it."""
    mail = EmailMessage(policy=POLICY)
    mail["From"] = sender
    mail["To"] = recipient
    mail["Subject"] = subject(message)
    mail["Date"] = datetime.fromisoformat(message["written"])
    mail["Message-ID"] = f"<{message['id']}@{sender.rpartition('@')[2]}>"
    mail["Auto-Submitted"] = "auto-generated"
    mail["Padwatch-Event-Id"] = message["id"]
    mail.set_content(text(message))
    return mail


async def _part(server: aiosmtplib.SMTP) -> None:
    """Say goodbye to a server that has taken the mail; whether it answers changes nothing."""
    with contextlib.suppress(aiosmtplib.SMTPException, OSError):
        async with asyncio.timeout(QUIT_S):
            await server.quit()


def _judged(error: aiosmtplib.SMTPResponseException) -> Outcome:
    """What a server means that does not take this mail."""
    for_ever = 500 <= error.code < 600 and error.code not in LOGIN_CODES
    return Refused(_said(error)) if for_ever else Failed(_said(error))


def _said(error: aiosmtplib.SMTPResponseException) -> str:
    return printable(f"{error.code} {error.message}")
