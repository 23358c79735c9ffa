"""The errors of RPCs as those of this package."""

from __future__ import annotations

from typing import Any

import grpc

from isomatch import _messages
from isomatch.errors import (
    AccessDenied,
    DataLoss,
    FailedPrecondition,
    InvalidInput,
    IsomatchError,
    NotFound,
    ResourceExhausted,
    Unavailable,
    in_our_words,
)

_DETAILS_KEY = "grpc-status-details-bin"

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
    field = violations[0].field if violations else None
    if field is not None:
        said, field = in_our_words(said, field)
    return _CLASSES.get(code, IsomatchError)(
        said,
        code=code,
        reason=info.reason,
        field=field,
        metadata=dict(info.metadata),
        retry_after=(
            retry.retry_delay.ToTimedelta().total_seconds()
            if retry.HasField("retry_delay")
            else None
        ),
    )
