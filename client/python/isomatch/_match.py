"""match: two meshes in, the map out."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from isomatch import _in_process
from isomatch._in_process import PreparedMesh
from isomatch._landmarks import integer, milliseconds
from isomatch._progress import followed
from isomatch.errors import IsomatchError, ServerSupportMissing, invalid
from isomatch.mesh import MeshLike, UploadedMesh, as_mesh
from isomatch.result import MatchResult
from isomatch.status import JobStatus

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from isomatch.client import Client


def match(
    x: MeshLike | PreparedMesh,
    y: MeshLike | PreparedMesh,
    *,
    landmarks: ArrayLike | None = None,
    landmarks_exact: bool = False,
    server: str | Client | None = None,
    profile: str = "default",
    relation: str = "whole",
    scale: str = "auto",
    random_seed: int = 1,
    threads: int = 0,
    solved_vertices: int | None = None,
    memory_limit_bytes: int = 0,
    deadline: float | None = None,
    priority: int = 0,
    progress: bool | None = None,
    on_progress: Callable[[JobStatus], object] | None = None,
    confidence: bool = True,
    precise: bool = True,
    alternative: bool = False,
    functional_map: bool = True,
    matched_y: bool = True,
) -> MatchResult:
    """Finds for every vertex of x its place on y.

    >>> isomatch.match((vertices_x, faces_x), "dog.off").y_from_x

    x, y: (vertices n x 3, faces m x 3), a path, a mesh of trimesh, Open3D, meshio,
      PyVista or Blender; or what `prepare` returned, or, with a server, `upload`.
    landmarks: k x 2, known matches (vertex of x, vertex of y); those that the rest
      contradicts are changed, unless landmarks_exact.
    server: None: in this process. HOST:PORT, or a Client (for TLS and API keys).
    relation: "whole", "part-of-y" where x is a part of y, "part-of-x" where y is one of
      x, "overlap" where each lacks something of the other, "auto" to find that out; scale:
      of parts, "same" where both have one unit, as overlaps need, "auto" finds it out.
    profile: "default" or "paper". random_seed: same input and seed, same map.
    threads: 0 for one a core, or the server's share. solved_vertices: larger meshes are
      decimated to about so many; 0 never; None as the profile says.
    memory_limit_bytes: no more is taken: fewer threads, then fewer solved vertices (a
      warning), or it is refused; 0 for no limit.
    deadline: seconds, after which the best map there is is the result, the first whole
      one at least; see `ended_early` of MatchResult.info. priority: on a server, -100 to 100.
    progress: a bar of tqdm after a second; None where that is installed and standard
      error is a terminal or a notebook. on_progress: called with each JobStatus.
    confidence, precise, alternative, functional_map, matched_y: what comes with the
      map, see MatchResult.

    Ctrl-C stops it; in another thread than the first, what on_progress raises does.
    InvalidInput, with `field`: something is wrong, or memory_limit_bytes is too little.
    ResourceExhausted: there is no memory left. OSError: a file cannot be opened.
    LibraryNotFound: nothing here can match, expected server=. With a server also what Client.submit and Job.result raise; when the call is interrupted or
    this process vanishes, the job is cancelled.
    """
    wanted = {
        "confidence": confidence,
        "precise": precise,
        "alternative": alternative,
        "functional_map": functional_map,
        "matched_y": matched_y,
    }
    with followed(progress, on_progress) as on_status:
        if server is not None:
            return _on_server(
                server,
                (x, y),
                wanted,
                on_status,
                landmarks=landmarks,
                landmarks_exact=landmarks_exact,
                profile=profile,
                relation=relation,
                scale=scale,
                random_seed=random_seed,
                threads=threads,
                solved_vertices=solved_vertices,
                memory_limit_bytes=memory_limit_bytes,
                deadline=deadline,
                priority=priority,
            )
        if priority != 0:
            raise invalid("priority", f"is {priority}, expected 0 without server=")
        options = _in_process.Options(
            profile=profile,
            relation=relation,
            scale=scale,
            random_seed=random_seed,
            threads=threads,
            memory_limit_bytes=memory_limit_bytes,
            landmarks_exact=integer("landmarks_exact", landmarks_exact, 0, 1),
            keep_functional_map=integer("functional_map", functional_map, 0, 1),
            solved_vertices=solved_vertices,
            deadline_milliseconds=milliseconds("deadline", deadline, profile),
        )
        return _in_process.match(
            x, y, landmarks=landmarks, options=options, on_status=on_status, wanted=wanted
        )


def _client(server: str | Client) -> contextlib.AbstractContextManager[Client]:
    """The caller's client stays open, one of our own is closed."""
    try:
        from isomatch.client import Client
    except ImportError as error:
        raise ServerSupportMissing(
            f"server: {error}; expected grpcio, protobuf and numpy: "
            "pip install 'isomatch[server]'"
        ) from error
    if isinstance(server, Client):
        return contextlib.nullcontext(server)
    if not isinstance(server, str) or not server:
        raise invalid("server", f"is {server!r}, expected HOST:PORT or a Client")
    return Client(server)


def _on_server(
    server: str | Client,
    pair: tuple[Any, Any],
    wanted: dict[str, bool],
    on_status: Callable[[JobStatus], None] | None,
    **options: Any,
) -> MatchResult:
    x, y = (_sent(value, field) for value, field in zip(pair, "xy"))
    with _client(server) as client:
        # Nobody else knows the job's name.
        job = client.submit(
            x, y, functional_map=wanted["functional_map"], cancel_when_unwatched=True, **options
        )
        try:
            return job.result(**wanted, on_progress=on_status)
        except BaseException:
            # What goes wrong while cancelling is not what the caller wants to know.
            with contextlib.suppress(IsomatchError):
                if not job.status.is_terminal:
                    job.cancel()
            raise


def _sent(value: Any, field: str) -> Any:
    """What Client.submit takes."""
    if isinstance(value, UploadedMesh):
        return value
    return as_mesh(value.mesh if isinstance(value, PreparedMesh) else value, field)
