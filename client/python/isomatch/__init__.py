"""Isomatch: dense correspondences between near-isometric 3D meshes.

>>> import isomatch
>>> result = isomatch.match("cat.off", (vertices, faces))
>>> result.y_from_x

`match` does it all in this process; `prepare` is for a mesh that is matched many times.
`Client` and `Job` are for jobs on a server, started, watched and fetched apart, also
from several processes. The manual is client/README.md of the project; what it says of
Python is in the wheel: importlib.metadata.metadata("isomatch").get_payload().
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from isomatch._in_process import PreparedMesh, prepare
from isomatch._match import match
from isomatch.errors import (
    AccessDenied,
    DataLoss,
    FailedPrecondition,
    InvalidInput,
    InvalidType,
    IsomatchError,
    JobCancelled,
    JobFailed,
    LibraryNotFound,
    NotFound,
    ResourceExhausted,
    ServerNotStarted,
    ServerSupportMissing,
    Unavailable,
)
from isomatch.mesh import MeshLike, UploadedMesh, read_mesh
from isomatch.result import FunctionalMap, MatchResult, PreciseMap
from isomatch.status import JobState, JobStatus, LandmarkOutcome, ResultInfo, ServerInfo, Verdict

if TYPE_CHECKING:
    from isomatch.client import Client, Job

__version__ = "0.1.0"

__all__ = [
    "AccessDenied",
    "DataLoss",
    "FailedPrecondition",
    "FunctionalMap",
    "InvalidInput",
    "InvalidType",
    "IsomatchError",
    "JobCancelled",
    "JobFailed",
    "JobState",
    "JobStatus",
    "LandmarkOutcome",
    "LibraryNotFound",
    "MatchResult",
    "MeshLike",
    "NotFound",
    "PreciseMap",
    "PreparedMesh",
    "ResourceExhausted",
    "ResultInfo",
    "ServerInfo",
    "ServerNotStarted",
    "ServerSupportMissing",
    "Unavailable",
    "UploadedMesh",
    "Verdict",
    "match",
    "prepare",
    "read_mesh",
]


def __getattr__(name: str) -> Any:
    """What needs gRPC is imported when it is asked for."""
    if name not in ("Client", "Job"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(importlib.import_module("isomatch.client"), name)
    except ImportError as error:
        raise ServerSupportMissing(
            f"isomatch.{name}: {error}; expected grpcio, protobuf and numpy: "
            "pip install 'isomatch[server]'"
        ) from error


def __dir__() -> list[str]:
    return sorted([*__all__, "Client", "Job", "__version__"])
