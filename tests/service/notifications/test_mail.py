"""Mail over a real SMTP server, and names of receivers that name servers look up."""

import asyncio
import email
import json
import socket
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack
from dataclasses import dataclass, field
from email.policy import default
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.notifications.channel import Delivered, Failed, Refused, TrustedAuthorities
from service.notifications.mail import Mail, mail_of
from service.notifications.message import Message
from service.notifications.webhook import Webhook
from service.settings.notifications import SmtpSettings

MESSAGE: Message = {
    "format": 1, "id": "5e4b", "type": "alarm", "plant": "Itaipu",
    "written": "2026-01-01T00:00:05.000Z", "url": "https://padwatch.example/#/alarms",
    "alarm": "U1:UJB:film_stiffness", "unit": "U1", "unit_name": "Unit 1", "subject": "UJB",
    "kind": "film_stiffness", "directions": "xy", "number": 1, "change": "raised",
    "priority": "danger",
    "is_active": True, "state": "unacknowledged", "occurrence": 1, "actor": "",
    "time": "2026-01-01T00:00:04.000Z", "raised": "2026-01-01T00:00:04.000Z",
    "reason": "film", "value": -18.1, "uncertainty": None, "limit": -10.0, "value_unit": "%",
    "operating_state": "full_load",
    "condition": {"oil_temperature_c": {"label": "Oil temperature", "value": 48.25, "unit": "°C",
                                        "uncertainty": None}},
}  # fmt: skip
BODY = json.dumps(MESSAGE)


@dataclass
class MailServer:
    """Speaks SMTP; ``replies`` replace what it says to a command."""

    replies: dict[str, str]
    tls: ssl.SSLContext | None
    port: int = 0
    commands: list[str] = field(default_factory=list)
    mails: list[bytes] = field(default_factory=list)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await self.say(writer, "GREETING", "220 mail.example ESMTP")
        while line := (await reader.readline()).decode().strip():
            self.commands.append(line)
            word = line.split()[0].upper()
            if word == "DATA" and "DATA" not in self.replies:
                await self.say(writer, "GO", "354 go on")
                self.mails.append((await reader.readuntil(b"\r\n.\r\n"))[:-3])
                await self.say(writer, "TAKEN", "250 taken as 4711")
                continue
            await self.say(writer, word, self.answer(word))
            if word == "STARTTLS" and self.tls is not None:
                await writer.start_tls(self.tls)
            if word == "QUIT":
                break
        writer.close()

    def answer(self, word: str) -> str:
        offers = "250-mail.example\r\n" + ("250-STARTTLS\r\n" if self.tls else "")
        return {
            "EHLO": f"{offers}250 AUTH PLAIN", "STARTTLS": "220 begin",
            "AUTH": "235 welcome", "QUIT": "221 bye",
        }.get(word, "250 fine")  # fmt: skip

    async def say(self, writer: asyncio.StreamWriter, word: str, usual: str) -> None:
        said = self.replies.get(word, usual)
        if said == "nothing":
            await asyncio.Event().wait()
        while said == "endless":
            writer.write(b"250-" + b"x" * 60 + b"\r\n")
            await writer.drain()
        writer.write(said.encode() + b"\r\n")
        await writer.drain()


ServeMail = Callable[..., Awaitable[MailServer]]


@pytest.fixture
async def serve(room: Any) -> AsyncIterator[ServeMail]:
    async with AsyncExitStack() as stack:

        async def start(tls: ssl.SSLContext | None = None, **replies: str) -> MailServer:
            server = MailServer(replies, tls)
            server.port = await stack.enter_async_context(room.serving(server.serve))
            return server

        yield start


def mail_to(server: MailServer, ca_file: Path | None = None, **changes: Any) -> Mail:
    settings = {
        "kind": "smtp", "id": "desk", "host": "127.0.0.1", "port": server.port, "tls": "none",
        "sender": "padwatch@x.example", "recipients": ["desk@x.example"],
        "connect_timeout_s": 20.0, "answer_timeout_s": 20.0, "total_timeout_s": 20.0,
        "ca_file": None if ca_file is None else str(ca_file), **changes,
    }  # fmt: skip
    valid = SmtpSettings.model_validate(settings)
    return Mail(valid, "desk@x.example", TrustedAuthorities(valid.ca_file))


async def test_a_mail_says_what_where_since_when_by_how_much_and_under_which_condition(serve):
    server = await serve()

    outcomes = [await mail_to(server).send(MESSAGE, BODY) for _ in range(2)]

    assert outcomes == [Delivered("taken as 4711")] * 2
    assert server.mails[0] == server.mails[1]
    mail = email.message_from_bytes(server.mails[0], policy=default)
    assert mail["Message-ID"] == "<5e4b@x.example>"
    where = "[padwatch] Itaipu: DANGER, U1 UJB"
    assert mail["Subject"].strip() == f"{where} film stiffness changed, x and y raised"
    text = mail.get_content()
    assert "Itaipu, U1 UJB (Unit 1)" in text
    assert "Since:     2026-01-01T00:00:04.000Z" in text
    assert "Confirmed: -18.1 % of the expected stiffness, on average; limit -10 %" in text
    assert "Operation: full load" in text
    assert "Oil temperature:     48.25 °C" in text
    assert "https://padwatch.example/#/alarms" in text


@pytest.mark.parametrize(
    ("word", "says", "outcome"),
    [
        ("GREETING", "421 too busy", Failed("421 too busy")),
        ("GREETING", "554 go away", Failed("554 go away")),
        ("MAIL", "451 later", Failed("451 later")),
        ("MAIL", "553 who are you", Refused("553 who are you")),
        ("RCPT", "450 greylisted", Failed("450 greylisted")),
        ("RCPT", "550-no such\r\n550 mailbox", Refused("550 no such mailbox")),
        ("DATA", "452 disk full", Failed("452 disk full")),
        ("TAKEN", "554 is spam", Refused("554 is spam")),
        ("TAKEN", "451 not now", Failed("451 not now")),
        ("TAKEN", "hello", Failed("-1 Malformed SMTP response line: hello")),
        ("EHLO", "endless", Failed("-1 Response too long")),
    ],
)
async def test_what_a_server_says_decides_between_later_and_never(word, says, outcome, serve):
    server = await serve(**{word: says})

    assert await mail_to(server).send(MESSAGE, BODY) == outcome


@pytest.mark.parametrize("word", ["GREETING", "EHLO", "MAIL", "TAKEN"])
async def test_a_server_that_falls_silent_is_left(word, serve):
    server = await serve(**{word: "nothing"})

    outcome = await mail_to(server, total_timeout_s=0.3).send(MESSAGE, BODY)

    assert isinstance(outcome, Failed)


@pytest.mark.parametrize("says", ["nothing", "500 no goodbye", "endless"])
async def test_a_mail_that_was_taken_is_delivered_whatever_comes_after(says, serve):
    server = await serve(QUIT=says)

    assert await mail_to(server).send(MESSAGE, BODY) == Delivered("taken as 4711")


async def test_login_and_mail_pass_only_under_tls_with_a_certificate_that_is_believed(
    serve, server_tls, certificate, tmp_path
):
    server = await serve(tls=server_tls)
    (tmp_path / "password").write_text("geheim\n")
    login = {
        "tls": "starttls",
        "username": "padwatch",
        "password": {"file": str(tmp_path / "password")},
    }

    refused = await mail_to(server, **login).send(MESSAGE, BODY)
    assert isinstance(refused, Failed)
    assert "certificate verify failed" in refused.answer.lower()
    assert server.commands[-1] == "STARTTLS"

    without_tls = await serve()
    in_the_clear = await mail_to(without_tls, certificate[0], **login).send(MESSAGE, BODY)
    assert isinstance(in_the_clear, Failed)
    assert [line.split()[0] for line in without_tls.commands if line[:4] in ("AUTH", "MAIL")] == []

    taken = await mail_to(server, certificate[0], **login).send(MESSAGE, BODY)
    assert taken == Delivered("taken as 4711")
    assert server.commands[-5] == "AUTH PLAIN AHBhZHdhdGNoAGdlaGVpbQ=="


async def test_a_missing_password_is_said_without_troubling_the_server(serve):
    server = await serve()
    missing = {
        "tls": "starttls",
        "username": "padwatch",
        "password": {"env": "PADWATCH_NO_SUCH_VARIABLE"},
    }

    outcome = await mail_to(server, **missing).send(MESSAGE, BODY)

    words = (
        "environment variable PADWATCH_NO_SUCH_VARIABLE must hold a single line of printable text"
    )
    assert outcome == Failed(words)
    assert server.commands == []


TEXTS = ("plant", "unit", "unit_name", "subject", "kind", "change", "actor", "reason", "url",
         "operating_state", "state")  # fmt: skip


@settings(max_examples=30)
@given(
    texts=st.fixed_dictionaries({key: st.text(max_size=60) for key in TEXTS}), extra=st.booleans()
)
def test_no_name_or_reason_can_forge_a_header(texts, extra):
    if extra:
        texts = {
            key: f"{text}\r\nBcc: thief@evil.example\r\n\r\n.\r\n" for key, text in texts.items()
        }

    mail = mail_of({**MESSAGE, **texts}, "padwatch@x.example", "desk@x.example").as_bytes()

    parsed = email.message_from_bytes(mail, policy=default)
    assert sorted(set(parsed.keys())) == sorted(
        ["From", "To", "Subject", "Date", "Message-ID", "Auto-Submitted", "Padwatch-Event-Id",
         "Content-Type", "Content-Transfer-Encoding", "MIME-Version"]
    )  # fmt: skip
    assert parsed["To"] == "desk@x.example"
    assert mail.isascii()


@pytest.fixture
def _name_server(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system's look-up, which knows one name."""

    def getaddrinfo(host: str, port: int, **_: object) -> list[Any]:
        if host == "desk.example":
            return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", port))] * 2
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr("acquisition.delivery.network.socket.getaddrinfo", getaddrinfo)


@pytest.mark.usefixtures("_name_server")
async def test_what_cannot_be_looked_up_or_trusted_is_said(room, tmp_path):
    webhook = Webhook(room.settings("https://no.example/"), room.clock)
    assert await webhook.send({"id": "1"}, "{}") == Failed("Name or service not known")

    webhook = Webhook(
        room.settings("https://127.0.0.1:1/", ca_file=str(tmp_path / "ca.pem")), room.clock
    )
    outcome = await webhook.send({"id": "1"}, "{}")
    assert isinstance(outcome, Failed)
    assert f"ca_file {tmp_path / 'ca.pem'}" in outcome.answer


@pytest.mark.usefixtures("_name_server")
async def test_a_message_goes_to_the_name_it_is_meant_for(room):
    server = await room.web(room.answers("200 OK"))
    url = f"http://desk.example:{server.port}/alarms?x=1"

    await Webhook(room.settings(url), room.clock).send({"id": "1"}, "{}")

    (request,) = server.requests
    assert request.headers["host"] == f"desk.example:{server.port}"
    assert request.line == "POST /alarms?x=1 HTTP/1.1"


async def test_nothing_is_told_to_a_server_with_a_false_certificate(room, server_tls, certificate):
    server = await room.web(room.answers("200 OK"), context=server_tls)
    trusting = room.settings(server.url, ca_file=str(certificate[0]))

    refused = await Webhook(room.settings(server.url), room.clock).send({"id": "1"}, "{}")
    assert isinstance(refused, Failed)
    assert "certificate verify failed" in refused.answer.lower()
    assert server.requests == []

    await Webhook(trusting, room.clock).send({"id": "1"}, "{}")
    assert len(server.requests) == 1
