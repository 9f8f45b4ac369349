"""Messages as mail over SMTP: one recipient, one connection, one answer that counts."""

import asyncio
import contextlib
import socket
from dataclasses import dataclass
from datetime import datetime
from email.message import EmailMessage
from email.policy import SMTP as SMTP_POLICY

import aiosmtplib

from acquisition.delivery.network import NameLookUp
from service.notifications.mail_text import subject, text
from service.notifications.message import Message
from service.notifications.network import (
    PATIENT,
    Timeouts,
    Trust,
    connected_socket,
    printable,
    words,
)
from service.notifications.outcome import Delivered, Failed, Outcome, Refused
from service.notifications.secret import Secret, SecretError

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
