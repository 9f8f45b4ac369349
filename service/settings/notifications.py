"""Receivers of notifications in the plant file: webhooks and mail servers."""

import re
from datetime import datetime, time
from typing import TYPE_CHECKING, Annotated, Literal, Self, get_args
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import Field, StringConstraints, model_validator

from core.alarms.alarm import AlarmChange
from core.units import NS_PER_S
from service.settings.alarm_kinds import AlarmKindName
from service.settings.base import (
    Identifier,
    MisfitError,
    Settings,
    refuse_twice,
)

TimeOfDay = Annotated[str, StringConstraints(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9]$")]
"""Hours and minutes, such as "22:00"."""

MailAddress = Annotated[
    str,
    StringConstraints(
        pattern=r"^[A-Za-z0-9.!#$%&'*+/=?^_`{|}~-]{1,64}@[A-Za-z0-9]([A-Za-z0-9.-]{0,252})$"
    ),
]
"""A plain address, without a name."""

HostName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.:-]{1,253}$")]

TimeoutS = Annotated[float, Field(gt=0.0, le=600.0)]

PRINTABLE_URL = re.compile(r"^[!-~]+$")

DEFAULT_CHANGES = (
    AlarmChange.RAISED,
    AlarmChange.ESCALATED,
    AlarmChange.EASED,
    AlarmChange.RETURNED,
)


class SecretSettings(Settings):
    """Place of a secret outside the plant file."""

    file: Annotated[str, StringConstraints(min_length=1)] | None = None
    """File with the secret only, read before each message; example: "/etc/padwatch/webhook.key"."""

    env: Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable with the secret; example: "PADWATCH_WEBHOOK_KEY"."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.file is None) == (self.env is None):
            raise MisfitError("give either file or env", "file")
        return self


class QuietSettings(Settings):
    """Daily quiet hours, in which only danger is sent; they may span midnight."""

    start: TimeOfDay
    """When they begin; example: "22:00"."""

    end: TimeOfDay
    """When they end; example: "06:00"."""

    time_zone: Annotated[str, StringConstraints(min_length=1, max_length=64)]
    """IANA name of the time zone of the hours; example: "America/Asuncion"."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.start == self.end:
            raise MisfitError("must differ from start", "end")
        try:
            ZoneInfo(self.time_zone)
        except (ZoneInfoNotFoundError, ValueError, OSError) as error:
            raise MisfitError('is not a known time zone such as "UTC"', "time_zone") from error
        return self

    def include(self, time_ns: int) -> bool:
        """Return whether a time lies within the quiet hours."""
        moment = datetime.fromtimestamp(time_ns // NS_PER_S, ZoneInfo(self.time_zone)).time()
        start, end = time.fromisoformat(self.start), time.fromisoformat(self.end)
        return start <= moment < end if start < end else moment >= start or moment < end


class ReceiverSettings(Settings):
    """Settings that all receivers share; a subclass adds its ``kind`` and its address."""

    id: Identifier
    """Name of the receiver and of its queue."""

    units: tuple[str, ...] | None = None
    """Units whose alarms it receives; all unless given; example: ["U1"]."""

    kinds: tuple[AlarmKindName, ...] | None = None
    """Kinds of alarms that it receives; all unless given. Example: ["link_lost"]."""

    changes: Annotated[tuple[AlarmChange, ...], Field(min_length=1)] = DEFAULT_CHANGES
    """Changes of an alarm that are sent."""

    lowest_priority: Literal["alert", "danger"] = "alert"
    """"alert" sends all alarms, "danger" only alarms that are, or were, a danger."""

    quiet: QuietSettings | None = None
    """Quiet hours, in which only danger is sent."""

    connect_timeout_s: TimeoutS = 10.0
    """Longest time to resolve the name and connect, s."""

    answer_timeout_s: TimeoutS = 30.0
    """Longest wait for an answer, s."""

    total_timeout_s: TimeoutS = 60.0
    """Longest duration of one attempt, s."""

    max_retry_s: Annotated[float, Field(ge=1.0, le=86_400.0)] = 900.0
    """Longest wait between two attempts, s; the first is after about one second, then twice as long
    each time. A longer wait requested by the receiver is ignored."""

    max_age_h: Annotated[float, Field(ge=0.1, le=8760.0)] = 72.0
    """Age of a message above which a failed attempt is the last, hours."""

    ca_file: Annotated[str, StringConstraints(min_length=1)] | None = None
    """Certificates (PEM) to trust instead of the system's; for a plant with a CA of its own;
    example: "/etc/padwatch/plant-ca.pem"."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the receivers in the outbox, one for each queue."""
        return (self.id,)


class WebhookSettings(ReceiverSettings):
    """A web server that takes each event as a POST of JSON."""

    kind: Literal["webhook"]
    """"webhook": an HTTP address that takes JSON."""

    url: Annotated[str, StringConstraints(min_length=1, max_length=2000)]
    """URL; redirects are not followed. Example: "https://alarms.example/padwatch"."""

    secret: SecretSettings | None = None
    """Key that signs each message (HMAC-SHA-256); unsigned without."""

    authorization: SecretSettings | None = None
    """Value of the Authorization header, such as "Bearer …"; none without."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        fault = url_fault(self.url)
        if fault is not None:
            raise MisfitError(fault, "url")
        if self.authorization is not None and not self.url.lower().startswith("https:"):
            raise MisfitError("would be sent unencrypted; use an https URL", "authorization")
        return self


class SmtpSettings(ReceiverSettings):
    """A mail server that takes each event as a mail to every recipient."""

    kind: Literal["smtp"]
    """"smtp": a mail server."""

    host: HostName
    """Mail server; example: "mail.plant.example"."""

    port: Annotated[int, Field(ge=1, le=65535)] = 587
    """Its port: 587 for STARTTLS, 465 for TLS from the start, 25 between servers."""

    tls: Literal["starttls", "implicit", "none"] = "starttls"
    """"starttls" (refused if the server does not offer it), "implicit" from the start, "none"."""

    username: Annotated[str, StringConstraints(min_length=1, max_length=200)] | None = None
    """Name for the login; no login unless given."""

    password: SecretSettings | None = None
    """Password for the login."""

    sender: MailAddress
    """Sender of the mails; example: "padwatch@plant.example"."""

    recipients: Annotated[tuple[MailAddress, ...], Field(min_length=1, max_length=50)]
    """Recipients; each has its own queue, so that no mailbox delays another."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.username is None) != (self.password is None):
            raise MisfitError("username and password must be given together", "username")
        if self.username is not None and self.tls == "none":
            raise MisfitError("would send the password unencrypted", "tls")
        refuse_twice(("recipients", n, each) for n, each in enumerate(self.recipients))
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the receivers in the outbox, one for each recipient."""
        return tuple(f"{self.id}:{recipient}" for recipient in self.recipients)


AnyReceiver = WebhookSettings | SmtpSettings
"""Receivers of all channels."""

if TYPE_CHECKING:
    ChannelKind = str
else:
    ChannelKind = Literal[tuple(t.model_fields["kind"].annotation for t in get_args(AnyReceiver))]
"""Name of a channel."""


class DeliverySettings(Settings):
    """Receivers of notifications."""

    dashboard_url: Annotated[str, StringConstraints(max_length=2000)] | None = None
    """URL of the dashboard for the link in each message; the service's own host and port unless
    given. Example: "https://padwatch.plant.example/"."""

    receiver: Annotated[
        tuple[Annotated[AnyReceiver, Field(discriminator="kind")], ...], Field(max_length=50)
    ] = ()
    """Receivers."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        fault = None if self.dashboard_url is None else url_fault(self.dashboard_url)
        if fault is not None:
            raise MisfitError(fault, "dashboard_url")
        refuse_twice(("receiver", n, "id", each.id) for n, each in enumerate(self.receiver))
        return self


def url_fault(url: str) -> str | None:
    """Return why an address cannot be used, or None."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return "is not a URL"
    if PRINTABLE_URL.match(url) is None or port == 0 or not parts.hostname:
        return "is not a URL of printable ASCII with a host"
    if parts.scheme.lower() not in ("http", "https"):
        return "must begin with https:// or http://"
    if "@" in parts.netloc:
        return "must not contain a name or password; use authorization"
    return None
