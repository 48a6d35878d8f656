"""A connection to an object store that is slow, wrong, or not there at all, as one asks."""

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Literal

Fault = Literal["slow", "truncated", "reset", "error", "garbage", "silent"]
ERROR = b"HTTP/1.1 500 Internal Server Error\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
AT_ONCE = struct.pack("ii", 1, 0)
"""Closes a connection by a reset."""


@dataclass
class BadStore:
    """Stands before a server; does harm to connections, then passes on what comes."""

    server: tuple[str, int]
    fault: Fault = "slow"
    times: int = 0
    """How many connections are still harmed."""
    seen: int = 0
    """How many there were."""
    held: list[socket.socket] = field(default_factory=list)

    def meet(self, client: socket.socket) -> None:
        self.seen += 1
        harmed, self.times = self.times > 0, self.times - 1
        with suppress(OSError):
            if harmed and self.fault == "silent":
                self.held.append(client)
                return
            if harmed and self.fault == "reset":
                client.recv(1)
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
            elif harmed and self.fault in ("error", "garbage"):
                client.recv(65536)
                client.sendall(ERROR if self.fault == "error" else b"\x00\xff what?\n" * 20)
            else:
                self.pass_on(client, harmed)
        client.close()

    def pass_on(self, client: socket.socket, harmed: bool) -> None:
        """Connect with the server, later or not to the end where that is asked for."""
        with socket.create_connection(self.server) as server:
            threading.Thread(target=pump, args=(client, server), daemon=True).start()
            if harmed and self.fault == "slow":
                time.sleep(0.5)
            if harmed and self.fault == "truncated":
                content = server.recv(65536)
                client.sendall(content[: len(content) * 2 // 3])
                return
            pump(server, client)


def pump(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while content := source.recv(65536):
            target.sendall(content)


@contextmanager
def bad_store(server: tuple[str, int]) -> Iterator[tuple[BadStore, int]]:
    """Listen before a server of this machine; yield what does harm, and the port."""
    store = BadStore(server)
    listener = socket.create_server(("127.0.0.1", 0))

    def accept() -> None:
        with suppress(OSError):
            while True:
                client, _ = listener.accept()
                threading.Thread(target=store.meet, args=(client,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield store, listener.getsockname()[1]
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()
        for client in store.held:
            client.close()
