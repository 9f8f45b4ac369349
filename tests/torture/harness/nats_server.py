"""Real NATS servers with JetStream, alone or three together; killed and started again."""

import json
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

WAIT_S = 20.0
N_NODES = 3

CLUSTER = """
server_name: n{number}
cluster {{
  name: padwatch
  listen: "127.0.0.1:{port}"
  routes: [{routes}]
}}
"""


def nats_server_command() -> str | None:
    """The server's program: the one of the environment, or an installed one."""
    own = Path(sys.executable).with_name("nats-server")
    return str(own) if own.exists() else shutil.which("nats-server")


class NatsServer:
    """One server over a folder; what it has confirmed is on the disk (``sync_interval: always``).

    Parameters
    ----------
    folder
        Takes its file, its log and all that it keeps.
    lines
        Added to its file: other limits, say.
    """

    def __init__(self, folder: Path, lines: str = "", *, has_jetstream: bool = True) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._lines, self._has_jetstream = folder, lines, has_jetstream
        self._process: subprocess.Popen[bytes] | None = None
        self.port = -1

    @property
    def url(self) -> str:
        """Where it is, also while it is not there."""
        return f"nats://127.0.0.1:{self.port}"

    @property
    def is_running(self) -> bool:
        """Whether it was started, and neither stopped nor killed since."""
        return self._process is not None

    def start(self) -> None:
        """Start it where it was before, with all that it had kept."""
        command = nats_server_command()
        if command is None:
            raise FileNotFoundError("nats-server")
        file = self._folder / "nats.conf"
        file.write_text(self._file())
        for old in self._folder.glob("*.ports"):
            old.unlink()
        with (self._folder / "nats.log").open("ab") as log:
            self._process = subprocess.Popen([command, "-c", str(file)], stdout=log, stderr=log)
        self.port = self._port_found()

    def kill(self) -> None:
        """End it as a crash would."""
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        """End it in order; if it runs at all."""
        if self._process is not None:
            self._end(signal.SIGTERM)

    @property
    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            raise ProcessLookupError("the server does not run")
        return self._process

    def _end(self, number: signal.Signals) -> None:
        process, self._process = self._running, None
        process.send_signal(number)
        try:
            process.wait(WAIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _file(self) -> str:
        store = self._folder / "store"
        jetstream = f'jetstream {{ store_dir: "{store}", sync_interval: always }}\n'
        return (
            f'listen: "127.0.0.1:{self.port}"\nports_file_dir: "{self._folder}"\n'
            f"{jetstream if self._has_jetstream else ''}{self._lines}\n"
        )

    def _port_found(self) -> int:
        deadline_s = time.monotonic() + WAIT_S
        while time.monotonic() < deadline_s:
            for file in self._folder.glob("*.ports"):
                try:
                    return int(json.loads(file.read_text())["nats"][0].rpartition(":")[2])
                except (ValueError, KeyError, IndexError):
                    break  # it is still being written
            if self._running.poll() is not None:
                break
            time.sleep(0.02)
        log = (self._folder / "nats.log").read_text(errors="replace")[-2000:]
        self.stop()
        raise TimeoutError(f"the server does not start:\n{log}")


@contextmanager
def nats_server(folder: Path, lines: str = "") -> Iterator[NatsServer]:
    """A server that runs, and none when this is left."""
    server = NatsServer(folder, lines)
    server.start()
    try:
        yield server
    finally:
        server.stop()


@contextmanager
def nats_cluster(folder: Path) -> Iterator[list[NatsServer]]:
    """Three servers that keep a stream together, and none when this is left."""
    with ExitStack() as held, ExitStack() as running:
        sockets = [
            held.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(N_NODES)
        ]
        ports = [one.getsockname()[1] for one in sockets]
        held.close()  # all are held until all are found
        routes = ", ".join(f'"nats://127.0.0.1:{port}"' for port in ports)
        lines = [CLUSTER.format(number=n, port=port, routes=routes) for n, port in enumerate(ports)]
        yield [
            running.enter_context(nats_server(folder / f"n{number}", line))
            for number, line in enumerate(lines)
        ]
