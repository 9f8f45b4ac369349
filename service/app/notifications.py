"""Receivers and routes of notifications, built from the plant file."""

from collections.abc import Iterator
from datetime import time
from pathlib import Path
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo

from acquisition.clock import Clock
from core.limits import AlarmLevel
from service.notifications.channel import Secret, Timeouts, Trust
from service.notifications.mail import Mail, MailTarget
from service.notifications.message import Composer, LookAround, Plant
from service.notifications.routing import QuietHours, Route, Router
from service.notifications.sender import Receiver
from service.notifications.webhook import Webhook, WebhookTarget
from service.settings.notifications import (
    ReceiverSettings,
    SecretSettings,
    SmtpSettings,
    WebhookSettings,
)
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.outbox import Address, no_recipients

LEVELS = {"alert": AlarmLevel.ALERT, "danger": AlarmLevel.DANGER}

SECONDS_PER_HOUR = 3600.0


def receivers_of(plant: PlantFile, origin: Origin, clock: Clock) -> list[Receiver]:
    """Return all receivers, one for each mail recipient; a replay has none."""
    if origin is not Origin.LIVE:
        return []
    return [found for each in plant.delivery.receiver for found in receivers(each, clock)]


def receivers(settings: ReceiverSettings, clock: Clock) -> Iterator[Receiver]:
    """Yield the receivers of one entry of the plant file."""
    trust = Trust(None if settings.ca_file is None else Path(settings.ca_file))
    timeouts = Timeouts(
        settings.connect_timeout_s, settings.answer_timeout_s, settings.total_timeout_s
    )
    if isinstance(settings, WebhookSettings):
        target = WebhookTarget(
            settings.url, _secret(settings.secret), _secret(settings.authorization), timeouts
        )
        shown = urlsplit(settings.url)  # without its path, which may contain a token
        address = f"{shown.scheme}://{shown.netloc}"
        yield _receiver(settings, settings.id, address, Webhook(target, trust, clock))
        return
    for recipient in settings.recipients:
        mailbox = MailTarget(
            host=settings.host,
            port=settings.port,
            sender=settings.sender,
            recipient=recipient,
            tls=settings.tls,
            username=settings.username,
            password=_secret(settings.password),
            timeouts=timeouts,
        )
        yield _receiver(settings, _name(settings, recipient), recipient, Mail(mailbox, trust))


def router_of(plant: PlantFile, origin: Origin, look: LookAround, clock: Clock) -> Address:
    """Return the router that queues messages of stored events; a replay queues none."""
    if origin is not Origin.LIVE or not plant.delivery.receiver:
        return no_recipients
    routes = [route for each in plant.delivery.receiver for route in _routes(each)]
    return Router(routes, composer_of(plant, look), clock.now_ns)


def composer_of(plant: PlantFile, look: LookAround) -> Composer:
    """Build the composer of messages about a plant."""
    service = plant.service
    host = f"[{service.host}]" if ":" in service.host else service.host
    scheme = "http" if service.tls is None else "https"
    is_found = service.port and service.socket is None
    own = f"{scheme}://{host}:{service.port}/" if is_found else None
    names = {unit.id: unit.name for unit in plant.unit}
    return Composer(Plant(plant.plant.name, plant.delivery.dashboard_url or own, names), look)


def _routes(settings: ReceiverSettings) -> Iterator[Route]:
    names = [settings.id]
    if isinstance(settings, SmtpSettings):
        names = [_name(settings, recipient) for recipient in settings.recipients]
    for name in names:
        yield Route(
            receiver=name,
            changes=frozenset(settings.changes),
            units=None if settings.units is None else frozenset(settings.units),
            kinds=None if settings.kinds is None else frozenset(settings.kinds),
            lowest=LEVELS[settings.lowest_priority],
        )


def _receiver(
    settings: ReceiverSettings, name: str, address: str, carrier: Webhook | Mail
) -> Receiver:
    quiet = None
    if settings.quiet is not None:
        start, end = (time.fromisoformat(t) for t in (settings.quiet.start, settings.quiet.end))
        quiet = QuietHours(start, end, ZoneInfo(settings.quiet.time_zone))
    return Receiver(
        name=name,
        kind=settings.kind,
        address=address,
        carrier=carrier,
        max_retry_s=settings.max_retry_s,
        max_age_s=SECONDS_PER_HOUR * settings.max_age_h,
        quiet=quiet,
    )


def _name(settings: SmtpSettings, recipient: str) -> str:
    return f"{settings.id}:{recipient}"


def _secret(settings: SecretSettings | None) -> Secret | None:
    if settings is None:
        return None
    return Secret(None if settings.file is None else Path(settings.file), settings.env)
