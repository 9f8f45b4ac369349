"""Construction of the receivers and the router of notifications from the plant file."""

from acquisition.clock import Clock
from service.notifications.channel import Channel, TrustedAuthorities
from service.notifications.mail import Mail
from service.notifications.message import Composer, FindContext
from service.notifications.routing import Router
from service.notifications.sender import Receiver
from service.notifications.webhook import Webhook
from service.settings.notifications import AnyReceiver, SmtpSettings, WebhookSettings
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.outbox import Address, no_recipients


def channels_of(settings: AnyReceiver, clock: Clock) -> list[Channel]:
    """Return one channel per recipient of a receiver in the plant file, in the given order."""
    match settings:
        case WebhookSettings():
            return [Webhook(settings, clock)]
        case SmtpSettings():
            trusted = TrustedAuthorities(settings.ca_file)
            return [Mail(settings, recipient, trusted) for recipient in settings.recipients]


def receivers_of(plant: PlantFile, origin: Origin, clock: Clock) -> list[Receiver]:
    """Return all receivers of notifications, one per mail recipient; a replay has none."""
    if origin is not Origin.LIVE:
        return []
    return [
        Receiver(name, settings, channel)
        for settings in plant.delivery.receiver
        for name, channel in zip(settings.names, channels_of(settings, clock), strict=True)
    ]


def router_of(plant: PlantFile, origin: Origin, context: FindContext, clock: Clock) -> Address:
    """Return the function that chooses the recipients of a stored event; none in a replay."""
    if origin is not Origin.LIVE or not plant.delivery.receiver:
        return no_recipients
    return Router(plant.delivery.receiver, composer_of(plant, context), clock.now_ns)


def composer_of(plant: PlantFile, context: FindContext) -> Composer:
    """Return the composer of the texts of the notifications of a plant."""
    service = plant.service
    host = f"[{service.host}]" if ":" in service.host else service.host
    scheme = "http" if service.tls is None else "https"
    is_found = service.port and service.socket is None
    own = f"{scheme}://{host}:{service.port}/" if is_found else None
    names = {unit.id: unit.name for unit in plant.unit}
    return Composer(plant.plant.name, plant.delivery.dashboard_url or own, names, context)
