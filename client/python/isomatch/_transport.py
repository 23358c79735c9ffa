"""One channel to one server: calls that are tried again while it is away."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pathlib
import random
import time
from collections.abc import AsyncIterator
from typing import Any

import grpc
import grpc.aio

from isomatch import _messages
from isomatch._rpc_errors import from_rpc
from isomatch.errors import IsomatchError, Unavailable

_SERVICE = "/isomatch.v1.CorrespondenceService/"

_FIRST_PAUSE_SECONDS = 0.1
_LONGEST_PAUSE_SECONDS = 2.0

# Of one attempt.
_CALL_SECONDS = 60.0
_FIRST_CALL_SECONDS = 3.0
_LONGEST_UNSURE_PATIENCE = 10.0

# gRPC's details of a call that its own application cancels.
_CANCELLED_HERE = "Locally cancelled by application!"

# Servers allow a ping every 20 s, and a watch sends nothing else.
_CHANNEL_OPTIONS = [
    ("grpc.initial_reconnect_backoff_ms", 250),
    ("grpc.min_reconnect_backoff_ms", 5000),
    ("grpc.max_reconnect_backoff_ms", 1000),
    ("grpc.keepalive_time_ms", 25000),
    ("grpc.keepalive_timeout_ms", 10000),
    ("grpc.http2.max_pings_without_data", 0),
    # Two clients of one process do not share a connection that has another key.
    ("grpc.use_local_subchannel_pool", 1),
]


class Backoff:
    """Growing pauses between attempts; `patience` seconds in all."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        """What happens next is a first failure."""
        self._pause = _FIRST_PAUSE_SECONDS
        self._give_up: float | None = None

    def pause_after(self, error: IsomatchError) -> float:
        """Seconds to wait before the next attempt; raises `error` when there is
        to be none."""
        now = time.monotonic()
        if self._give_up is None:
            self._give_up = now + self._patience
        if not isinstance(error, Unavailable) or now + self._pause > self._give_up:
            raise error
        # Clients of a server that comes back do not come together.
        pause = self._pause * random.uniform(0.8, 1.2)
        self._pause = min(2 * self._pause, _LONGEST_PAUSE_SECONDS)
        return pause


class Rpcs:
    """The RPCs of the service on a channel, sync or aio, by their names."""

    def __init__(self, channel: Any) -> None:
        for method in _messages.service_methods():
            arity = "{}_{}".format(
                "stream" if method.client_streaming else "unary",
                "stream" if method.server_streaming else "unary",
            )
            request = _messages.class_of_type(method.input_type)
            response = _messages.class_of_type(method.output_type)
            callable_ = getattr(channel, arity)(
                _SERVICE + method.name,
                request_serializer=request.SerializeToString,
                response_deserializer=response.FromString,
            )
            setattr(self, method.name, callable_)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"no RPC {name}")


def _pem(path: str | os.PathLike[str] | None) -> bytes | None:
    return None if path is None else pathlib.Path(path).read_bytes()


class Transport:
    """REQUIRES: tls_cert and tls_key both or none. Thread-safe."""

    def __init__(
        self,
        address: str,
        tls_ca: str | os.PathLike[str] | None,
        tls_cert: str | os.PathLike[str] | None,
        tls_key: str | os.PathLike[str] | None,
        api_key: str | None,
        patience: float,
    ) -> None:
        self.address = address
        self.patience = patience
        # Not gRPC's call credentials, which refuse to work without TLS, and so
        # on loopback and behind a proxy.
        self.metadata = (("authorization", f"Bearer {api_key}"),) if api_key else ()
        self._credentials = None
        if tls_ca is not None:
            self._credentials = grpc.ssl_channel_credentials(
                _pem(tls_ca), _pem(tls_key), _pem(tls_cert)
            )
        self._channel = self._open(grpc)
        self.rpcs = Rpcs(self._channel)

    def _open(self, library: Any) -> Any:
        """A channel of grpc or of grpc.aio."""
        if self._credentials is None:
            return library.insecure_channel(self.address, options=_CHANNEL_OPTIONS)
        return library.secure_channel(
            self.address, self._credentials, options=_CHANNEL_OPTIONS
        )

    def close(self) -> None:
        self._channel.close()

    def call(self, rpc: Any, request: Any) -> Any:
        """The response of a unary RPC that is safe to send again."""
        backoff = Backoff(self.patience)
        while True:
            try:
                return rpc(request, metadata=self.metadata, timeout=_CALL_SECONDS)
            except grpc.RpcError as error:
                pause = backoff.pause_after(from_rpc(error))
            time.sleep(pause)

    def first_call(self, rpc: Any, request: Any) -> Any:
        """As call, but soon given up, as the address may be wrong, unless the
        patience is longer than it is by default.
        """
        seconds = self.patience
        if seconds <= _LONGEST_UNSURE_PATIENCE:
            seconds = min(seconds, _FIRST_CALL_SECONDS)
        backoff = Backoff(seconds)
        try:
            while True:
                try:
                    timeout = max(seconds, _FIRST_CALL_SECONDS)
                    return rpc(request, metadata=self.metadata, timeout=timeout)
                except grpc.RpcError as error:
                    pause = backoff.pause_after(from_rpc(error))
                time.sleep(pause)
        except IsomatchError as error:
            if error.code not in ("UNAVAILABLE", "DEADLINE_EXCEEDED"):
                raise
            raise Unavailable(
                f"{self.address}: no answer, expected a running isomatch-server: {error}"
            ) from None

    @contextlib.asynccontextmanager
    async def aio_rpcs(self) -> AsyncIterator[Rpcs]:
        """On a channel that belongs to the running event loop."""
        async with self._open(grpc.aio) as channel:
            yield Rpcs(channel)


async def _is_cancelled_here(call: Any) -> bool:
    """Whether a task that awaited the call was itself cancelled."""
    task: Any = asyncio.current_task()
    if task is None or not call.done():
        return True
    if hasattr(task, "cancelling"):
        return bool(task.cancelling())
    # Before Python 3.11 only gRPC tells, which then cancels its call.
    return bool(await call.details() == _CANCELLED_HERE)


async def rpc_error(call: Any, error: BaseException) -> IsomatchError:
    """What an aio call ended with, unless the task itself is cancelled."""
    if isinstance(error, grpc.RpcError):
        return from_rpc(error)
    if await _is_cancelled_here(call):
        raise error
    return Unavailable("the server ended the call")
