"""A TCP connection that is cut at a word: before it has reached the server, or with the answer."""

import selectors
import socket
from contextlib import suppress
from threading import Lock, Thread


class CuttingProxy:
    """Passes connections on to a server on loopback; cuts one when it hears a word.

    Parameters
    ----------
    port
        Of the server.
    """

    def __init__(self, port: int) -> None:
        self._server = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._lock = Lock()
        self._word: bytes | None = None
        self._reaches = False
        self.n_cut = 0
        Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> "CuttingProxy":
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.close()

    def cut_at(self, word: bytes, *, reaches: bool) -> None:
        """Cut the next connection that says a word; whether the server still hears it."""
        with self._lock:
            self._word, self._reaches = word, reaches

    def _accept(self) -> None:
        with suppress(OSError):  # closed
            while True:
                client, _ = self._listener.accept()
                Thread(target=self._pass_on, args=(client,), daemon=True).start()

    def _pass_on(self, client: socket.socket) -> None:
        with (
            client,
            suppress(OSError),
            socket.create_connection(("127.0.0.1", self._server)) as server,
            selectors.DefaultSelector() as ready,
        ):
            ready.register(client, selectors.EVENT_READ, server)
            ready.register(server, selectors.EVENT_READ, client)
            while True:
                for key, _ in ready.select():
                    heard = key.fileobj.recv(65536)  # type: ignore[union-attr]
                    if not heard:
                        return
                    if key.fileobj is client and self._is_cut(heard):
                        if self._reaches:
                            server.sendall(heard)
                            server.recv(65536)  # done there, but nobody is told
                        return
                    key.data.sendall(heard)

    def _is_cut(self, heard: bytes) -> bool:
        with self._lock:
            if self._word is None or self._word not in heard:
                return False
            self._word = None
            self.n_cut += 1
            return True
