"""Settings of the receivers of notifications: webhooks and mail servers."""

import re
from datetime import datetime, time
from typing import TYPE_CHECKING, Annotated, Literal, Self, get_args
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import Field, StringConstraints, model_validator

from core.alarms.alarm import AlarmChange
from core.units import NS_PER_S
from service.settings.alarm_kinds import AlarmKindName
from service.settings.base import Identifier, MisfitError, Settings, refuse_twice

TimeOfDay = Annotated[str, StringConstraints(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9]$")]
"""Time of day in hours and minutes, such as "22:00"."""

MailAddress = Annotated[
    str,
    StringConstraints(
        pattern=r"^[A-Za-z0-9.!#$%&'*+/=?^_`{|}~-]{1,64}@[A-Za-z0-9]([A-Za-z0-9.-]{0,252})$"
    ),
]
"""Mail address without a display name."""

HostName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.:-]{1,253}$")]

TimeoutS = Annotated[float, Field(gt=0.0, le=600.0)]

PRINTABLE_URL = re.compile(r"^[!-~]+$")

DEFAULT_CHANGES = (
    *(AlarmChange.RAISED, AlarmChange.ESCALATED, AlarmChange.EASED, AlarmChange.RETURNED),
)


class SecretSettings(Settings):
    """Location of a secret outside the plant file: a file or an environment variable."""

    file: Annotated[str, StringConstraints(min_length=1)] | None = None
    """File that contains only the secret, read before each message; example:
    "/etc/padwatch/webhook.key"."""

    env: Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable with the secret; example: "PADWATCH_WEBHOOK_KEY"."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.file is None) == (self.env is None):
            raise MisfitError("exactly one of file and env must be given", "file")
        return self


class QuietSettings(Settings):
    """Daily quiet hours, in which only danger alarms are sent; they may span midnight."""

    start: TimeOfDay
    """Start of the quiet hours; example: "22:00"."""

    end: TimeOfDay
    """End of the quiet hours; example: "06:00"."""

    time_zone: Annotated[str, StringConstraints(min_length=1, max_length=64)]
    """IANA name of the time zone of start and end; example: "America/Asuncion"."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.start == self.end:
            raise MisfitError("must differ from start", "end")
        try:
            ZoneInfo(self.time_zone)
        except (ZoneInfoNotFoundError, ValueError, OSError) as error:
            raise MisfitError('is not a known IANA time zone such as "UTC"', "time_zone") from error
        return self

    def include(self, time_ns: int) -> bool:
        """Return whether a time, ns since 1970 UTC, is in the quiet hours; the end is excluded."""
        moment = datetime.fromtimestamp(time_ns // NS_PER_S, ZoneInfo(self.time_zone)).time()
        start, end = time.fromisoformat(self.start), time.fromisoformat(self.end)
        return start <= moment < end if start < end else moment >= start or moment < end


class ReceiverSettings(Settings):
    """Settings common to all receivers; each subclass adds its ``kind`` and its address."""

    id: Identifier
    """Id of the receiver, unique in the plant file, and name of its queue."""

    units: tuple[str, ...] | None = None
    """Ids of the units whose alarms are sent; all units by default; example: ["U1"]."""

    kinds: tuple[AlarmKindName, ...] | None = None
    """Alarm kinds that are sent; all kinds by default. Example: ["link_lost"]."""

    changes: Annotated[tuple[AlarmChange, ...], Field(min_length=1)] = DEFAULT_CHANGES
    """Alarm changes that are sent; by default raised, escalated, eased and returned."""

    lowest_priority: Literal["alert", "danger"] = "alert"
    """Lowest priority that is sent: "alert" sends all alarms, "danger" only alarms that are, or
    were, a danger."""

    quiet: QuietSettings | None = None
    """Quiet hours, in which only danger alarms are sent; none by default."""

    connect_timeout_s: TimeoutS = 10.0
    """Time limit for resolving the host name and connecting, s."""

    answer_timeout_s: TimeoutS = 30.0
    """Time limit for a response of the receiver, s."""

    total_timeout_s: TimeoutS = 60.0
    """Time limit for one delivery attempt, s."""

    max_retry_s: Annotated[float, Field(ge=1.0, le=86_400.0)] = 900.0
    """Maximum delay between two delivery attempts, s. The delay is about one second after the first
    attempt and doubles after each attempt. A longer delay requested by the receiver is ignored."""

    max_age_h: Annotated[float, Field(ge=0.1, le=8760.0)] = 72.0
    """Age of a message above which delivery is not retried, hours."""

    ca_file: Annotated[str, StringConstraints(min_length=1)] | None = None
    """File with the trusted CA certificates (PEM), instead of those of the system; for a plant with
    a private CA; example: "/etc/padwatch/plant-ca.pem"."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the queues of this receiver in the outbox; its only queue has its id as name."""
        return (self.id,)


class WebhookSettings(ReceiverSettings):
    """Settings of a webhook: a web server that receives each event as a JSON POST request."""

    kind: Literal["webhook"]
    """Kind of the receiver, always "webhook"."""

    url: Annotated[str, StringConstraints(min_length=1, max_length=2000)]
    """URL of the webhook; redirects are not followed. Example:
    "https://alarms.example/padwatch"."""

    secret: SecretSettings | None = None
    """Key that signs each message (HMAC-SHA-256); messages are unsigned by default."""

    authorization: SecretSettings | None = None
    """Value of the Authorization header, such as "Bearer …"; no header by default."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        fault = _url_fault(self.url)
        if fault is not None:
            raise MisfitError(fault, "url")
        if self.authorization is not None and not self.url.lower().startswith("https:"):
            raise MisfitError("would be sent unencrypted; use an https URL", "authorization")
        return self


class SmtpSettings(ReceiverSettings):
    """Settings of a mail server, which sends a mail about each event to every recipient."""

    kind: Literal["smtp"]
    """Kind of the receiver, always "smtp"."""

    host: HostName
    """Host name of the mail server; example: "mail.plant.example"."""

    port: Annotated[int, Field(ge=1, le=65535)] = 587
    """TCP port of the mail server: 587 for STARTTLS, 465 for implicit TLS, 25 between servers."""

    tls: Literal["starttls", "implicit", "none"] = "starttls"
    """Encryption: "starttls" (mails are not sent if the server does not offer STARTTLS), "implicit"
    (TLS from the start of the connection) or "none"."""

    username: Annotated[str, StringConstraints(min_length=1, max_length=200)] | None = None
    """User name for the login; no login by default."""

    password: SecretSettings | None = None
    """Password for the login; required with username."""

    sender: MailAddress
    """Mail address of the sender; example: "padwatch@plant.example"."""

    recipients: Annotated[tuple[MailAddress, ...], Field(min_length=1, max_length=50)]
    """Mail addresses of the recipients. Each recipient has a separate queue, so that an unavailable
    mailbox does not delay the mails to other recipients."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.username is None) != (self.password is None):
            raise MisfitError("username and password must be given together", "username")
        if self.username is not None and self.tls == "none":
            words = 'would send the password unencrypted; use "starttls" or "implicit"'
            raise MisfitError(words, "tls")
        refuse_twice(("recipients", n, each) for n, each in enumerate(self.recipients))
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the queues of this receiver in the outbox, one for each recipient."""
        return tuple(f"{self.id}:{recipient}" for recipient in self.recipients)


AnyReceiver = WebhookSettings | SmtpSettings
"""Settings of any kind of receiver."""

if TYPE_CHECKING:
    ChannelKind = str
else:
    ChannelKind = Literal[tuple(t.model_fields["kind"].annotation for t in get_args(AnyReceiver))]
"""Kind of a receiver, "webhook" or "smtp"."""


class DeliverySettings(Settings):
    """Settings of the delivery of notifications."""

    dashboard_url: Annotated[str, StringConstraints(max_length=2000)] | None = None
    """URL of the dashboard for the link in each message; by default built from host and port of the
    service. Example: "https://padwatch.plant.example/"."""

    receiver: Annotated[
        tuple[Annotated[AnyReceiver, Field(discriminator="kind")], ...], Field(max_length=50)
    ] = ()
    """Receivers of notifications, at most 50."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        fault = None if self.dashboard_url is None else _url_fault(self.dashboard_url)
        if fault is not None:
            raise MisfitError(fault, "dashboard_url")
        refuse_twice(("receiver", n, "id", each.id) for n, each in enumerate(self.receiver))
        return self


def _url_fault(url: str) -> str | None:
    """Return why a URL is not a valid HTTP(S) URL without credentials; None if it is valid."""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return "is not a valid URL"
    if PRINTABLE_URL.match(url) is None or port == 0 or not parts.hostname:
        return "must be a URL with a host, in printable ASCII characters"
    if parts.scheme.lower() not in ("http", "https"):
        return "must begin with https:// or http://"
    if "@" in parts.netloc:
        return "must not contain a user name or password; use authorization"
    return None
