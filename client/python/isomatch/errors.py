"""What can go wrong, one class for each thing that a caller does about it.

Every error has the canonical gRPC `code`, the stable `reason` of the table in
proto/README.md, and the `field` that was wrong, where there is one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import grpc

from isomatch import _messages

_DETAILS_KEY = "grpc-status-details-bin"


class IsomatchError(Exception):
    """The base of all errors of this package.

    code: "INVALID_ARGUMENT" and so on.
    reason: UPPER_SNAKE_CASE, stable; "" when gRPC itself made the error.
    field: path of what was wrong, e.g. "x.faces" or "landmarks[3].x"; or None.
    metadata: the numbers and names of the message.
    retry_after: seconds after which the same may succeed, or None.
    """

    code = "UNKNOWN"

    def __init__(
        self,
        message: str,
        *,
        code: str | None = None,
        reason: str = "",
        field: str | None = None,
        metadata: Mapping[str, str] | None = None,
        retry_after: float | None = None,
    ) -> None:
        super().__init__(message)
        self.code = code or type(self).code
        self.reason = reason
        self.field = field
        self.metadata = dict(metadata or {})
        self.retry_after = retry_after


class InvalidInput(IsomatchError, ValueError):
    """Something given is wrong; `field` says what. Correct it."""

    code = "INVALID_ARGUMENT"


class InvalidType(InvalidInput, TypeError):
    """What was given is of no type that is taken there; the message names those."""


class NotFound(IsomatchError, LookupError):
    """The server has no such job, or the result no such part."""

    code = "NOT_FOUND"


class Unavailable(IsomatchError):
    """No server, or it was lost and did not come back."""

    code = "UNAVAILABLE"


class AccessDenied(IsomatchError):
    """The API key is missing, unknown, or may not do this."""

    code = "PERMISSION_DENIED"


class ResourceExhausted(IsomatchError):
    """The queue or a store is full, see `retry_after`; or too little memory."""

    code = "RESOURCE_EXHAUSTED"


class FailedPrecondition(IsomatchError):
    """Not in this state of the job or of the server."""

    code = "FAILED_PRECONDITION"


class DataLoss(IsomatchError):
    """A result is damaged, on the server or on its way."""

    code = "DATA_LOSS"


class JobFailed(IsomatchError):
    """The job ended as FAILED; code and reason are the job's."""


class JobCancelled(IsomatchError):
    """The job ended as CANCELLED."""

    code = "CANCELLED"


class ServerNotStarted(IsomatchError):
    """No embedded server: the binary was not found, or did not start."""

    code = "UNAVAILABLE"


_CLASSES: dict[str, type[IsomatchError]] = {
    "INVALID_ARGUMENT": InvalidInput,
    "OUT_OF_RANGE": InvalidInput,
    "ALREADY_EXISTS": InvalidInput,
    "NOT_FOUND": NotFound,
    "UNAVAILABLE": Unavailable,
    "UNAUTHENTICATED": AccessDenied,
    "PERMISSION_DENIED": AccessDenied,
    "RESOURCE_EXHAUSTED": ResourceExhausted,
    "FAILED_PRECONDITION": FailedPrecondition,
    "DATA_LOSS": DataLoss,
}


def _details(error: Any) -> list[Any]:
    for key, value in error.trailing_metadata() or ():
        if key == _DETAILS_KEY:
            return list(_messages.ErrorStatus.FromString(value).details)
    return []


def _unpack(details: list[Any], message_class: Any) -> Any:
    """The detail of this class; an empty one when there is none."""
    for detail in details:
        if detail.Is(message_class.DESCRIPTOR):
            return message_class.FromString(detail.value)
    return message_class()


def from_rpc(error: grpc.RpcError) -> IsomatchError:
    """Returns what a call ended with as an error of this package.

    A server that stops ends its calls as cancelled; since nobody here wanted
    that, it is Unavailable. So is INTERNAL without details from gRPC itself: a
    proxy that loses its server resets the streams.
    """
    code = error.code().name
    if code == "CANCELLED":
        return Unavailable("the server ended the call")
    details = _details(error)
    said = error.details() or code
    if code == "INTERNAL" and not details and "RST_STREAM" in said:
        return Unavailable(said)
    info = _unpack(details, _messages.ErrorInfo)
    violations = _unpack(details, _messages.BadRequest).field_violations
    retry = _unpack(details, _messages.RetryInfo)
    return _CLASSES.get(code, IsomatchError)(
        said,
        code=code,
        reason=info.reason,
        field=violations[0].field if violations else None,
        metadata=dict(info.metadata),
        retry_after=(
            retry.retry_delay.ToTimedelta().total_seconds()
            if retry.HasField("retry_delay")
            else None
        ),
    )
