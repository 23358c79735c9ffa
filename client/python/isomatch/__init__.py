"""Isomatch: dense correspondences between near-isometric 3D meshes.

>>> import isomatch
>>> result = isomatch.match("cat.off", (vertices, faces))
>>> result.y_from_x

`match` does it all in one call; `Client` and `Job` are for jobs that are started,
watched and fetched apart, also from several processes. See client/README.md.
"""

from isomatch._match import match
from isomatch.client import Client, Job
from isomatch.errors import (
    AccessDenied,
    DataLoss,
    FailedPrecondition,
    InvalidInput,
    InvalidType,
    IsomatchError,
    JobCancelled,
    JobFailed,
    NotFound,
    ResourceExhausted,
    ServerNotStarted,
    Unavailable,
)
from isomatch.mesh import MeshLike, UploadedMesh, read_mesh
from isomatch.result import FunctionalMap, MatchResult, PreciseMap
from isomatch.status import JobState, JobStatus, LandmarkOutcome, ResultInfo, ServerInfo, Verdict

__version__ = "0.1.0"

__all__ = [
    "AccessDenied",
    "Client",
    "DataLoss",
    "FailedPrecondition",
    "FunctionalMap",
    "InvalidInput",
    "InvalidType",
    "IsomatchError",
    "Job",
    "JobCancelled",
    "JobFailed",
    "JobState",
    "JobStatus",
    "LandmarkOutcome",
    "MatchResult",
    "MeshLike",
    "NotFound",
    "PreciseMap",
    "ResourceExhausted",
    "ResultInfo",
    "ServerInfo",
    "ServerNotStarted",
    "Unavailable",
    "UploadedMesh",
    "Verdict",
    "match",
    "read_mesh",
]
