"""Jobs and their results, and what a server says about itself, as values."""

from __future__ import annotations

import dataclasses
import datetime
import enum
from collections.abc import Mapping
from dataclasses import dataclass

from isomatch.errors import IsomatchError, JobCancelled, JobFailed


class JobState(enum.Enum):
    QUEUED = "QUEUED"
    RUNNING = "RUNNING"
    SUCCEEDED = "SUCCEEDED"
    FAILED = "FAILED"
    CANCELLED = "CANCELLED"


_TERMINAL = {JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED}


@dataclass(frozen=True)
class JobError:
    """Why a job FAILED; reason as in the table of proto/README.md."""

    code: str
    reason: str
    message: str


@dataclass(frozen=True)
class MeshSummary:
    """area: squared mesh units. warnings: what was found and mended."""

    vertices: int
    faces: int
    area: float
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Scores:
    """What speaks for and against a map. All are 0 at best, except
    orientation_score (-1 mirrored to 1 kept); smaller rank_values are better."""

    embedding_error: float
    orientation_score: float
    curvature_mismatch: float
    normal_mismatch: float
    descriptor_mismatch: float
    stretch: float
    landmark_contradiction: float
    rank_value: float


@dataclass(frozen=True)
class Quality:
    """geodesic_distortion: a fraction of sqrt(area). coverage of Y, 0 to 1.
    area_distortion: mean |ln|. mean_confidence: 0 to 1."""

    geodesic_distortion: float
    coverage: float
    area_distortion: float
    mean_confidence: float


@dataclass(frozen=True)
class Verdict:
    """level: "good", "doubtful" or "bad", "unknown" of a server that did not judge.
    reason: why. advice: what to do about it, empty for a good map."""

    level: str
    reason: str
    advice: str

    def __str__(self) -> str:
        reason = f" ({self.reason})" if self.reason else ""
        advice = f": {self.advice}" if self.advice else ""
        return self.level + reason + advice


@dataclass(frozen=True)
class LandmarkOutcome:
    """kept: the map sends x to y. Otherwise the rest of the map contradicts the
    landmark and sends x to y_found (-1: nowhere), at this distance from y, a
    fraction of sqrt(area)."""

    x: int
    y: int
    kept: bool
    y_found: int
    distance: float


@dataclass(frozen=True)
class ResultInfo:
    """What is known of a result without a truth. Seconds and bytes.

    verdict: what a person would say who looked at the map.

    symmetry_confidence: 0 to 1, how clearly the map is better than
    `alternatives`, which are the scores of the maps not chosen, best first.
    relation: "whole", "part-of-y", "part-of-x" or "overlap"; relation_confidence: 0 to
    1, how sure that is where it was found out. scale: X's lengths times it are in Y's
    unit. unmatched: vertices of X without a counterpart. parts: what can
    be downloaded. ended_early: the deadline came before the map was refined to the end.
    """

    mesh_x: MeshSummary
    mesh_y: MeshSummary
    verdict: Verdict
    scores: Scores
    quality: Quality
    symmetry_confidence: float
    alternatives: tuple[Scores, ...]
    landmarks: tuple[LandmarkOutcome, ...]
    unmatched: int
    objective: float
    stage_seconds: Mapping[str, float]
    run_seconds: float
    peak_resident_bytes: int
    warnings: tuple[str, ...]
    profile: str
    relation: str
    relation_confidence: float
    scale: float
    random_seed: int
    ended_early: bool
    parts: tuple[str, ...]


@dataclass(frozen=True)
class JobRun:
    """timeout: what the job may run, as asked for, or what the server's max_run_time
    cut that to; None for no limit. faults: how often it took the server down, or was
    asked to stop and did not; with the third it fails. unresponsive: it was asked to
    stop and did not, so that its worker was given up."""

    timeout: datetime.timedelta | None
    faults: int
    unresponsive: bool


@dataclass(frozen=True)
class JobStatus:
    """One snapshot of a job.

    stage: "geodesics" and so on, "starting" before the first, "working" for one
    that this package does not know. Fractions: 0 to 1, never falling.
    has_map: a whole map is there, what a deadline would end with.
    waiting_for: while QUEUED "turn"; "storage" when the server's disk takes no
    results, "inputs" when its meshes cannot be read just now; else "".
    result: set when SUCCEEDED; error: set when FAILED.
    """

    name: str
    state: JobState
    stage: str
    stage_fraction: float
    total_fraction: float
    has_map: bool
    queue_position: int
    waiting_for: str
    memory_estimate_bytes: int
    sequence: int
    attempt: int
    priority: int
    tenant: str
    labels: Mapping[str, str]
    run: JobRun
    create_time: datetime.datetime | None
    start_time: datetime.datetime | None
    end_time: datetime.datetime | None
    error: JobError | None
    result: ResultInfo | None

    @property
    def is_terminal(self) -> bool:
        return self.state in _TERMINAL

    def failure(self) -> IsomatchError | None:
        """Why there is no result; None while there may be one."""
        if self.state is JobState.CANCELLED:
            return JobCancelled(f"{self.name} was cancelled", reason="JOB_CANCELLED")
        if self.error is None:
            return None
        message = f"{self.name} failed: {self.error.message} ({self.error.reason})"
        return JobFailed(message, code=self.error.code, reason=self.error.reason)


def running(
    stage: str, stage_fraction: float, total_fraction: float, has_map: bool
) -> JobStatus:
    """Of a match in this process."""
    return JobStatus(
        name="",
        state=JobState.RUNNING,
        stage=stage,
        stage_fraction=stage_fraction,
        total_fraction=total_fraction,
        has_map=has_map,
        queue_position=0,
        waiting_for="",
        memory_estimate_bytes=0,
        sequence=0,
        attempt=1,
        priority=0,
        tenant="",
        labels={},
        run=JobRun(timeout=None, faults=0, unresponsive=False),
        create_time=None,
        start_time=None,
        end_time=None,
        error=None,
        result=None,
    )


def succeeded(info: ResultInfo) -> JobStatus:
    """The last of a match in this process."""
    last = running("quality", 1.0, 1.0, True)
    return dataclasses.replace(last, state=JobState.SUCCEEDED, result=info)


@dataclass(frozen=True)
class Limits:
    """Of requests and of the server; those of one tenant are the caller's, where
    0 stands for no limit of its own."""

    max_request_bytes: int
    max_chunk_bytes: int
    max_mesh_bytes: int
    max_vertices: int
    max_faces: int
    max_landmarks: int
    max_queued_jobs: int
    max_queued_jobs_per_tenant: int
    max_running_jobs_per_tenant: int
    max_bytes_per_tenant: int
    max_kept_jobs_per_tenant: int
    max_uploads_per_tenant: int
    max_upload_bytes_per_tenant: int
    max_requests_per_tenant: int
    max_priority: int


@dataclass(frozen=True)
class ServerInfo:
    """draining: it stops and takes no new jobs. durable: jobs and results
    survive the end of the server. tenant: whose key the call came with.
    workers, memory_budget_bytes: 0 at a gateway while no worker is running.
    max_run_time: what a job may run, whatever its run_timeout; None for no limit."""

    version: str
    limits: Limits
    workers: int
    threads_per_job: int
    queued_jobs: int
    running_jobs: int
    memory_budget_bytes: int
    memory_reserved_bytes: int
    draining: bool
    durable: bool
    job_retention: datetime.timedelta
    tenant: str
    max_run_time: datetime.timedelta | None
