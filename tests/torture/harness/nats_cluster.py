"""Three NATS servers that keep a stream together, on loopback."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from harness.nats_server import NatsServer

N_NODES = 3

LINES = """
server_name: n{number}
cluster {{
  name: padwatch
  listen: "127.0.0.1:{port}"
  routes: [{routes}]
}}
"""


class NatsCluster:
    """A cluster whose nodes are killed one at a time."""

    def __init__(self, folder: Path) -> None:
        ports = _free_ports()
        routes = ", ".join(f'"nats://127.0.0.1:{port}"' for port in ports)
        self.nodes = [
            NatsServer(folder / f"n{number}", LINES.format(number=number, port=port, routes=routes))
            for number, port in enumerate(ports, start=1)
        ]

    @property
    def urls(self) -> list[str]:
        """Where the nodes are."""
        return [node.url for node in self.nodes]

    def kill(self, number: int) -> None:
        """Kill a node, and start it again over what it has kept."""
        node = self.nodes[number % len(self.nodes)]
        node.kill()
        node.start()


def _free_ports() -> list[int]:
    """Ports that are free now; all are held until all are found."""
    with ExitStack() as held:
        sockets = [held.enter_context(socket.socket()) for _ in range(N_NODES)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [int(one.getsockname()[1]) for one in sockets]


@contextmanager
def nats_cluster(folder: Path) -> Iterator[NatsCluster]:
    """Three servers that run, and none when this is left."""
    cluster = NatsCluster(folder)
    try:
        for node in cluster.nodes:
            node.start()
        yield cluster
    finally:
        for node in cluster.nodes:
            node.stop()
