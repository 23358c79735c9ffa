"""CreateJobRequest and its parts from what the caller gives, checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from isomatch import _messages
from isomatch._draco import EncodedMesh
from isomatch._landmarks import check_vertices, integer, landmark_pairs
from isomatch.errors import invalid
from isomatch.mesh import UploadedMesh

# Room in a request for what its meshes need beside their bytes, and more.
OVERHEAD_BYTES = 4096


def part_number(name: str) -> int:
    """ "precise map" as RESULT_PART_PRECISE_MAP."""
    value = "RESULT_PART_" + name.upper().replace(" ", "_")
    return _messages.enum_number("ResultPart", value)


def _number(enum_type: str, field: str, name: str) -> int:
    """ "part-of-y" as RELATION_PART_OF_Y."""
    prefix = _messages.enum_names(enum_type)[0].removesuffix("UNSPECIFIED")
    known = {
        full.removeprefix(prefix).lower().replace("_", "-"): full
        for full in _messages.enum_names(enum_type)[1:]
    }
    if not isinstance(name, str) or name not in known:
        *names, last = map(repr, known)
        raise invalid(field, f"is {name!r}, expected {', '.join(names)} or {last}")
    return _messages.enum_number(enum_type, known[name])


def _add_landmarks(request: Any, landmarks: ArrayLike) -> None:
    for x, y in landmark_pairs(landmarks):
        request.landmarks.add(x=x, y=y)


def check_landmarks(request: Any, vertices_x: int, vertices_y: int) -> None:
    """InvalidInput when one names no vertex."""
    pairs = [(landmark.x, landmark.y) for landmark in request.landmarks]
    check_vertices(pairs, vertices_x, vertices_y)


def set_mesh(message: Any, mesh: EncodedMesh | UploadedMesh) -> None:
    """Fills a Mesh message, by value or by digest."""
    if isinstance(mesh, EncodedMesh):
        message.draco = mesh.data
    else:
        message.digest.sha256 = mesh.sha256
        message.digest.size_bytes = mesh.size_bytes
    order = "ID_ATTRIBUTE" if mesh.by_id else "DECODED"
    message.vertex_order = _messages.enum_number("VertexOrder", f"VERTEX_ORDER_{order}")
    message.vertex_count = mesh.vertices


def create_job(
    *,
    landmarks: ArrayLike | None,
    landmarks_exact: bool,
    profile: str,
    relation: str,
    scale: str,
    random_seed: int,
    threads: int,
    solved_vertices: int | None,
    memory_limit_bytes: int,
    deadline: float | None,
    functional_map: bool,
    priority: int,
    labels: Mapping[str, str] | None,
    queue_timeout: float | None,
    run_timeout: float | None,
    cancel_when_unwatched: bool,
) -> Any:
    """All but the meshes and the request_id; Client.submit tells the rest."""
    request = _messages.CreateJobRequest(
        labels=labels, priority=integer("priority", priority, -(2**31), 2**31 - 1)
    )
    options = request.options
    options.profile = _number("Profile", "profile", profile)
    options.relation = _number("Relation", "relation", relation)
    options.scale = _number("LengthScale", "scale", scale)
    options.random_seed = integer("random_seed", random_seed, 0, 2**64 - 1)
    options.threads = integer("threads", threads, 0, 2**32 - 1)
    options.landmarks_exact = landmarks_exact
    options.functional_map = functional_map
    if solved_vertices is not None:
        options.solved_vertices = integer(
            "solved_vertices", solved_vertices, 0, 2**32 - 1
        )
    options.memory_limit_bytes = integer(
        "memory_limit_bytes", memory_limit_bytes, 0, 2**63 - 1
    )
    if landmarks is not None:
        _add_landmarks(request, landmarks)
    for field, seconds in (
        ("queue_timeout", queue_timeout),
        ("run_timeout", run_timeout),
        ("deadline", deadline),
    ):
        if seconds is not None:
            getattr(request, field).FromNanoseconds(round(seconds * 1e9))
    if cancel_when_unwatched:
        request.disconnect_policy = _messages.enum_number(
            "DisconnectPolicy", "DISCONNECT_POLICY_CANCEL"
        )
    return request
