"""Messages of the server as the values of isomatch.status."""

from __future__ import annotations

import dataclasses
import datetime
from typing import Any, TypeVar

from isomatch import _messages
from isomatch.status import (
    JobError,
    JobRun,
    JobState,
    JobStatus,
    LandmarkOutcome,
    Limits,
    MeshSummary,
    Quality,
    ResultInfo,
    Scores,
    ServerInfo,
    Verdict,
)

_T = TypeVar("_T")

# The names of google.rpc.Code by number.
_CODES = (
    "OK CANCELLED UNKNOWN INVALID_ARGUMENT DEADLINE_EXCEEDED NOT_FOUND ALREADY_EXISTS "
    "PERMISSION_DENIED RESOURCE_EXHAUSTED FAILED_PRECONDITION ABORTED OUT_OF_RANGE "
    "UNIMPLEMENTED INTERNAL UNAVAILABLE DATA_LOSS UNAUTHENTICATED"
).split()


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
        relation=_label("Relation", message.relation or 1).replace(" ", "-"),
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
        has_map=job.progress.has_map,
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
