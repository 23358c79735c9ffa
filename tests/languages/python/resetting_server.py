"""A server that resets every stream, as a proxy does that loses its server."""

import contextlib
import socket
import threading

_PREFACE_BYTES = 24
_HEADERS = 1
_RST_STREAM = 3
_SETTINGS = 4
_ACK = 1


def _frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    head = len(payload).to_bytes(3, "big") + bytes([kind, flags])
    return head + stream.to_bytes(4, "big") + payload


class ResettingServer:
    """with ResettingServer(error_code) as server: server.address, .streams."""

    def __init__(self, error_code: int) -> None:
        self._reset = error_code.to_bytes(4, "big")
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = "127.0.0.1:{}".format(self._listener.getsockname()[1])
        #: How many were begun; `began` is notified of each.
        self.streams = 0
        self.began = threading.Condition()

    def wait_for_streams(self, count: int, seconds: float) -> bool:
        with self.began:
            return self.began.wait_for(lambda: self.streams >= count, seconds)

    def __enter__(self) -> "ResettingServer":
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *exc_info: object) -> None:
        # Wakes the thread that accepts, which close alone does not.
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with contextlib.suppress(OSError), connection, connection.makefile("rb") as received:
            received.read(_PREFACE_BYTES)
            connection.sendall(_frame(_SETTINGS, 0, 0))
            while head := received.read(9):
                received.read(int.from_bytes(head[:3], "big"))
                stream = int.from_bytes(head[5:9], "big")
                if head[3] == _SETTINGS and not head[4] & _ACK:
                    connection.sendall(_frame(_SETTINGS, _ACK, 0))
                elif head[3] == _HEADERS:
                    with self.began:
                        self.streams += 1
                        self.began.notify_all()
                    connection.sendall(_frame(_RST_STREAM, 0, stream, self._reset))
