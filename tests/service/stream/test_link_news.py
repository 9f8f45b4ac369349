"""What is told of a link takes no room, however long nobody hears it."""

from acquisition.clock import SystemClock
from service.live import LinkState
from service.roles.link_news import LinkNews
from service.settings.plant import PlantFile
from service.settings.stream import StreamSettings
from service.stream.identity import UnitIdentity
from service.stream.publisher import Publisher


def test_news_of_a_link_do_not_pile_up_while_the_servers_are_away(
    plant: PlantFile, identity: UnitIdentity
) -> None:
    unit = plant.unit[0].id
    waiting = Publisher(
        plant, StreamSettings(servers=("nats://127.0.0.1:9",)), {unit: identity}, SystemClock()
    )
    for second in range(1000):
        waiting.tell(LinkNews(unit, LinkState.NOT_CONNECTED, f"silent for {second} s"))

    queue = waiting.waiting._waiting[unit]
    assert len(queue) == 2
    assert waiting.waiting.n_bytes == sum(len(message.payload) for message in queue)
    assert b"999 s" in queue[-1].payload
