"""Notification channel by mail (SMTP): one recipient, one connection per delivery attempt."""

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from datetime import datetime
from email.message import EmailMessage
from email.policy import SMTP as SMTP_POLICY

import aiosmtplib

from acquisition.delivery.network import HostAddresses
from core.alarms.kinds import FILM_STIFFNESS
from service.notifications.channel import (
    Delivered,
    Failed,
    Outcome,
    Refused,
    SecretError,
    TrustedAuthorities,
    connected_socket,
    error_text,
    printable,
    read_secret,
)
from service.notifications.message import Message
from service.settings.alarm_kinds import kind_words
from service.settings.notifications import SmtpSettings

CHANGES = {"escalated": "rose to danger", "eased": "eased to alert"}

WHOLE_UNIT = ("device", "link")

DISCLAIMER = "padwatch monitors conditions and is not a protection system; this mail informs only."


def subject(message: Message) -> str:
    """Return the subject of the mail about a message: one line without control characters."""
    if message["type"] == "test":
        return printable(f"[padwatch] {message['plant']}: test message")
    priority = (message["priority"] or "").upper() if message["is_active"] else "over"
    words = f"{_place(message)} {_what(message)} {change_words(message)}"
    return printable(f"[padwatch] {message['plant']}: {priority}, {words}")


def text(message: Message) -> str:
    """Return the plain text of the mail about a message."""
    lines = _test(message) if message["type"] == "test" else _alarm(message)
    return "\n".join(lines) + "\n"


def change_words(message: Message) -> str:
    """Return the change of the alarm that an alarm message reports, in words."""
    change: str = message["change"]
    return CHANGES.get(change, change.replace("_", " "))


def value_words(message: Message) -> str | None:
    """Return the value of an alarm, its 95 % uncertainty and its limit in a message as text.

    None if the alarm has no value.
    """
    value, limit, std = message["value"], message["limit"], message["uncertainty"]
    if value is None:
        return None
    unit = message["value_unit"] or ""
    spread = "" if std is None else f" ± {2 * std:.2g} (95 %)"
    passed = "" if limit is None else f"; limit {limit:g} {unit}"
    if message["kind"] == FILM_STIFFNESS:
        return f"{value:+.1f} {unit} of the expected stiffness, on average{passed}"
    return f"{value:.4g}{spread} {unit}{passed}"


def _alarm(message: Message) -> Iterator[str]:
    named = f" ({message['unit_name']})" if message["unit_name"] else ""
    rows = [
        ("What", f"{_what(message)}: {change_words(message)}"),
        ("Priority", message["priority"]),
        ("Where", f"{message['plant']}, {_place(message)}{named}"),
        ("When", message["time"]),
        ("Since", message["raised"]),
        ("Confirmed" if message["kind"] == FILM_STIFFNESS else "Value", value_words(message)),
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
    yield "Alarms of this plant will be sent to this address."
    yield from ("", *_foot(message))


def _foot(message: Message) -> Iterator[str]:
    if message["url"]:
        yield f"Dashboard: {message['url']}"
    yield f"Event: {message['id']}"
    yield DISCLAIMER


def _what(message: Message) -> str:
    return kind_words(message["kind"], message["directions"])


def _place(message: Message) -> str:
    about_part = message["subject"] not in WHOLE_UNIT
    return f"{message['unit']} {message['subject']}" if about_part else str(message["unit"])


QUIT_S = 2.0
"""Maximum wait for the reply to QUIT."""

LOGIN_CODES = (503, 530, 534, 535, 538)
"""Reply codes of class 5xx that reject the login, not the mail (RFC 4954, section 6)."""

POLICY = SMTP_POLICY.clone(cte_type="7bit", max_line_length=76)


class Mail:
    """Notification channel that sends each message as a mail to one recipient."""

    def __init__(self, settings: SmtpSettings, recipient: str, trusted: TrustedAuthorities) -> None:
        self.address = recipient
        self._settings, self._trusted = settings, trusted
        self._look_up = HostAddresses(settings.host, settings.port)

    async def send(self, message: Message, body: str) -> Outcome:  # noqa: ARG002
        """Make one delivery attempt over a new SMTP connection; return its outcome or failure."""
        mail = mail_of(message, self._settings.sender, self.address).as_bytes()
        try:
            async with asyncio.timeout(self._settings.total_timeout_s):
                return await self._delivered(mail)
        except aiosmtplib.SMTPRecipientsRefused as error:
            return _outcome(error.recipients[0])
        except (aiosmtplib.SMTPSenderRefused, aiosmtplib.SMTPDataError) as error:
            return _outcome(error)
        except aiosmtplib.SMTPResponseException as error:
            return Failed(_reply(error))
        except (aiosmtplib.SMTPException, OSError, ValueError, SecretError) as error:
            # the message of the cause does not have the prefix of the library
            cause = error.__cause__ if isinstance(error.__cause__, OSError) else error
            return Failed(printable(error_text(cause)))

    async def _delivered(self, mail: bytes) -> Outcome:
        settings = self._settings
        sock = await connected_socket(self._look_up, settings.port, settings.connect_timeout_s)
        try:
            server = await self._client(sock)
            try:
                await self._log_in(server)
                _, reply = await server.sendmail(settings.sender, [self.address], mail)
                with contextlib.suppress(aiosmtplib.SMTPException, OSError):
                    async with asyncio.timeout(QUIT_S):  # the mail has been accepted
                        await server.quit()
            finally:
                server.close()
        finally:
            sock.close()
        return Delivered(printable(reply))

    async def _client(self, sock: socket.socket) -> aiosmtplib.SMTP:
        settings = self._settings
        return aiosmtplib.SMTP(
            hostname=settings.host,
            sock=sock,
            local_hostname=printable(socket.gethostname()).replace(" ", "-") or "padwatch",
            timeout=settings.answer_timeout_s,
            use_tls=settings.tls == "implicit",
            start_tls=False,  # `_log_in` requires it
            tls_context=await self._trusted.context() if settings.tls != "none" else None,
        )

    async def _log_in(self, server: aiosmtplib.SMTP) -> None:
        """Connect to the server, start TLS and log in.

        Raises `SecretError` before the connection if the password cannot be read.
        """
        settings = self._settings
        password = read_secret(settings.password) if settings.password else None
        await server.connect()
        if settings.tls == "starttls":
            await server.starttls()
        if settings.username is not None and password is not None:
            await server.login(settings.username, password)


def mail_of(message: Message, sender: str, recipient: str) -> EmailMessage:
    """Return the mail of a message, equal for all attempts, marked as auto-generated (RFC 3834)."""
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


def _outcome(error: aiosmtplib.SMTPResponseException) -> Outcome:
    is_permanent = 500 <= error.code < 600 and error.code not in LOGIN_CODES
    return Refused(_reply(error)) if is_permanent else Failed(_reply(error))


def _reply(error: aiosmtplib.SMTPResponseException) -> str:
    return printable(f"{error.code} {error.message}")
