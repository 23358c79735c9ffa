"""What can go wrong, one class for each thing that a caller does about it.

Every error has the canonical gRPC `code`, the stable `reason` of the table in
proto/README.md, and the `field` that was wrong, where there is one.
"""

from __future__ import annotations

from collections.abc import Mapping


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


def invalid(field: str, message: str) -> InvalidInput:
    """Of an argument."""
    return InvalidInput(f"{field}: {message}", reason="INVALID_FIELD", field=field)


# What isomatch.h and service.proto call the arguments of `match`.
_ARGUMENTS = {"mesh_x": "x", "shape_x": "x", "mesh_y": "y", "shape_y": "y"}


def in_our_words(message: str, field: str) -> tuple[str, str]:
    """A message that begins with its field, and the field, as this package calls it."""
    head, dot, rest = field.partition(".")
    here = rest if head == "options" else _ARGUMENTS.get(head, head) + dot + rest
    if message.startswith(f"{field}:"):
        message = here + message[len(field) :]
    return message, here


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


class LibraryNotFound(IsomatchError):
    """No libisomatch.so.0, which matches in this process and reads files."""

    code = "UNAVAILABLE"


class ServerSupportMissing(IsomatchError, ImportError):
    """server= and Client need grpcio, protobuf and numpy, which are not installed."""

    code = "UNAVAILABLE"
