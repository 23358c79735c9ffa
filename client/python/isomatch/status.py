"""What the server says about itself, its jobs and their results, as values."""

from __future__ import annotations

import dataclasses
import datetime
import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from isomatch import _messages
from isomatch.errors import IsomatchError, JobCancelled, JobFailed

_T = TypeVar("_T")

# The names of google.rpc.Code by number.
_CODES = (
    "OK CANCELLED UNKNOWN INVALID_ARGUMENT DEADLINE_EXCEEDED NOT_FOUND ALREADY_EXISTS "
    "PERMISSION_DENIED RESOURCE_EXHAUSTED FAILED_PRECONDITION ABORTED OUT_OF_RANGE "
    "UNIMPLEMENTED INTERNAL UNAVAILABLE DATA_LOSS UNAUTHENTICATED"
).split()


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
    unmatched: vertices of X on no face. parts: what can be downloaded.
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
    random_seed: int
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
    waiting_for: while QUEUED "turn"; "storage" when the server's disk takes no
    results, "inputs" when its meshes cannot be read just now; else "".
    result: set when SUCCEEDED; error: set when FAILED.
    """

    name: str
    state: JobState
    stage: str
    stage_fraction: float
    total_fraction: float
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


def _as(target: type[_T], message: Any, **given: Any) -> _T:
    """A dataclass from the message's fields of the same names."""
    names = {field.name for field in dataclasses.fields(target)}  # type: ignore[arg-type]
    copied = {name: getattr(message, name) for name in names - given.keys()}
    return target(**copied, **given)


def _label(enum_type: str, number: int) -> str:
    """STAGE_ZOOMOUT as "zoomout"."""
    name = _messages.enum_name(enum_type, number)
    if name is None:
        return "working"
    if name.endswith("_UNSPECIFIED"):
        return "starting"
    return name.partition("_")[2].lower().replace("_", " ")


def _time(message: Any, field: str) -> datetime.datetime | None:
    if not message.HasField(field):
        return None
    time: datetime.datetime = getattr(message, field).ToDatetime(datetime.timezone.utc)
    return time


def _duration(message: Any, field: str) -> datetime.timedelta | None:
    if not message.HasField(field):
        return None
    duration: datetime.timedelta = getattr(message, field).ToTimedelta()
    return duration


def _mesh_summary(message: Any) -> MeshSummary:
    return _as(MeshSummary, message, warnings=tuple(message.warnings))


def _landmark(message: Any) -> LandmarkOutcome:
    found = -1 if message.y_found == 0xFFFFFFFF else message.y_found
    landmark = message.landmark
    return _as(LandmarkOutcome, message, x=landmark.x, y=landmark.y, y_found=found)


def _verdict_level(number: int) -> str:
    """LEVEL_GOOD as "good"."""
    name = _messages.enum_name("Verdict.Level", number) or ""
    level = name.partition("_")[2].lower()
    return level if level not in ("", "unspecified") else "unknown"


def _result_info(message: Any) -> ResultInfo:
    return _as(
        ResultInfo,
        message,
        mesh_x=_mesh_summary(message.mesh_x),
        mesh_y=_mesh_summary(message.mesh_y),
        verdict=_as(Verdict, message.verdict, level=_verdict_level(message.verdict.level)),
        scores=_as(Scores, message.scores),
        quality=_as(Quality, message.quality),
        alternatives=tuple(_as(Scores, a.scores) for a in message.alternatives),
        landmarks=tuple(_landmark(outcome) for outcome in message.landmarks),
        stage_seconds={_label("Stage", t.stage): t.seconds for t in message.stage_times},
        warnings=tuple(message.warnings),
        profile=_label("Profile", message.profile),
        parts=tuple(part_name(info.part) for info in message.parts),
    )


def part_name(number: int) -> str:
    """RESULT_PART_PRECISE_MAP as "precise map"."""
    name = _messages.enum_name("ResultPart", number) or f"RESULT_PART_{number}"
    return name.removeprefix("RESULT_PART_").lower().replace("_", " ")


def _job_error(message: Any) -> JobError:
    code = _CODES[message.code] if message.code < len(_CODES) else "UNKNOWN"
    return _as(JobError, message, code=code)


def _waiting_for(job: Any) -> str:
    """WAIT_REASON_STORAGE as "storage"."""
    if job.state != _messages.enum_number("Job.State", "STATE_QUEUED"):
        return ""
    name = _messages.enum_name("Job.WaitReason", job.waiting_for) or "WAIT_REASON_UNSPECIFIED"
    return name.removeprefix("WAIT_REASON_").lower().replace("unspecified", "turn")


def job_status(job: Any) -> JobStatus:
    """Of a Job message."""
    state = _messages.enum_name("Job.State", job.state) or ""
    return _as(
        JobStatus,
        job,
        state=JobState(state.removeprefix("STATE_")),
        stage=_label("Stage", job.progress.stage),
        stage_fraction=job.progress.stage_fraction,
        total_fraction=job.progress.total_fraction,
        waiting_for=_waiting_for(job),
        labels=dict(job.labels),
        run=_as(JobRun, job.run, timeout=_duration(job.run, "timeout")),
        create_time=_time(job, "create_time"),
        start_time=_time(job, "start_time"),
        end_time=_time(job, "end_time"),
        error=_job_error(job.error) if job.HasField("error") else None,
        result=_result_info(job.result) if job.HasField("result") else None,
    )


def server_info(message: Any) -> ServerInfo:
    """Of a GetServerInfoResponse."""
    return _as(
        ServerInfo,
        message,
        limits=_as(Limits, message.limits),
        job_retention=message.job_retention.ToTimedelta(),
        max_run_time=_duration(message, "max_run_time"),
    )
