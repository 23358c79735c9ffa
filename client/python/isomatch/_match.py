"""match: two meshes in, the map out."""

from __future__ import annotations

import contextlib

from numpy.typing import ArrayLike

from isomatch.client import Client, OnProgress
from isomatch.errors import IsomatchError
from isomatch.mesh import MeshLike
from isomatch.result import MatchResult


def _client(server: str | Client | None) -> contextlib.AbstractContextManager[Client]:
    """The caller's client stays open, one of our own is closed."""
    if isinstance(server, Client):
        return contextlib.nullcontext(server)
    return Client(server)


def match(
    x: MeshLike,
    y: MeshLike,
    *,
    landmarks: ArrayLike | None = None,
    landmarks_exact: bool = False,
    server: str | Client | None = None,
    profile: str = "default",
    random_seed: int = 1,
    threads: int = 0,
    solved_vertices: int | None = None,
    memory_limit_bytes: int = 0,
    priority: int = 0,
    on_progress: OnProgress | None = None,
    confidence: bool = True,
    precise: bool = False,
    alternative: bool = False,
    functional_map: bool = False,
) -> MatchResult:
    """Finds for every vertex of x its place on y.

    >>> isomatch.match((vertices_x, faces_x), "dog.off").y_from_x

    server: HOST:PORT, a Client (for TLS and API keys), or None: a server of this
    process's own, see Client. on_progress: called with each JobStatus.
    confidence, precise, alternative, functional_map: what comes with the map,
    see MatchResult. The others are those of Client.submit.

    When this call is interrupted (Ctrl-C) or fails, the job is cancelled on the
    server; it is too when this process vanishes. Errors: as Client.submit and
    Job.result raise them.
    """
    with _client(server) as client:
        job = client.submit(
            x,
            y,
            landmarks=landmarks,
            landmarks_exact=landmarks_exact,
            profile=profile,
            random_seed=random_seed,
            threads=threads,
            solved_vertices=solved_vertices,
            memory_limit_bytes=memory_limit_bytes,
            functional_map=functional_map,
            priority=priority,
            # Nobody else knows the job's name.
            cancel_when_unwatched=True,
        )
        try:
            return job.result(
                confidence=confidence,
                precise=precise,
                alternative=alternative,
                functional_map=functional_map,
                on_progress=on_progress,
            )
        except BaseException:
            # What goes wrong while cancelling is not what the caller wants to know.
            with contextlib.suppress(IsomatchError):
                if not job.status.is_terminal:
                    job.cancel()
            raise
