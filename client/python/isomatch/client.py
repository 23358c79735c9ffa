"""Client: a connection to a server. Job: one job there."""

from __future__ import annotations

import asyncio
import hashlib
import os
import time
import uuid
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping
from typing import Any, Union

import grpc
from numpy.typing import ArrayLike

from isomatch import _draco, _messages, _parts, _requests, _server, _status_messages, status
from isomatch._rpc_errors import from_rpc
from isomatch._transport import Backoff, Transport, rpc_error
from isomatch.errors import (
    DataLoss,
    FailedPrecondition,
    IsomatchError,
    Unavailable,
    invalid,
)
from isomatch.mesh import Mesh, MeshLike, UploadedMesh, as_mesh
from isomatch.result import MatchResult
from isomatch.status import JobState, JobStatus, ServerInfo

_Path = Union[str, "os.PathLike[str]"]

#: Called with each snapshot of the job.
OnProgress = Callable[[JobStatus], object]

# How the parts that Job.result can be asked for are decoded.
_DECODERS: dict[str, Callable[[bytes, int, int], Any]] = {
    "confidence": _parts.decode_confidence,
    "precise map": _parts.decode_precise,
    "alternative map": _parts.decode_map,
    "functional map": _parts.decode_functional_map,
    "mask y": _parts.decode_mask_y,
}


def _mesh_or_none(value: MeshLike) -> Mesh | None:
    """One that was checked already."""
    return value if isinstance(value, Mesh) else None


class Client:
    """A connection to one server. Thread-safe; close it, or use `with`.

    server: HOST:PORT or unix:PATH; None: the embedded server of this process,
      an `isomatch-server --ephemeral` that is found by ISOMATCH_SERVER_BINARY or
      in PATH, started once and stopped at exit.
    tls_ca: PEM file that the server's certificate is checked with; encrypts.
    tls_cert, tls_key: PEM files of a certificate of one's own.
    api_key: the key itself; by default the environment's ISOMATCH_API_KEY.
    patience: seconds to try again while the server is away; one that never
      answered has 3, unless this is more than 10.
    """

    def __init__(
        self,
        server: str | None = None,
        *,
        tls_ca: _Path | None = None,
        tls_cert: _Path | None = None,
        tls_key: _Path | None = None,
        api_key: str | None = None,
        patience: float = 10.0,
    ) -> None:
        if (tls_cert is None) != (tls_key is None):
            raise invalid("tls_key", "and tls_cert are of use together only")
        if tls_cert is not None and tls_ca is None:
            raise invalid("tls_ca", "is None, expected a file beside tls_cert")
        if server is None:
            server, api_key = _server.embedded_address(), ""
        elif api_key is None:
            api_key = os.environ.get("ISOMATCH_API_KEY")
        self._transport = Transport(server, tls_ca, tls_cert, tls_key, api_key, patience)
        self._known_limits: status.Limits | None = None

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        self._transport.close()

    @property
    def server(self) -> str:
        """Its address."""
        return self._transport.address

    def info(self) -> ServerInfo:
        """Version, limits and load. Unavailable: no answer within 3 s."""
        request = _messages.GetServerInfoRequest()
        rpc = self._transport.rpcs.GetServerInfo
        return _status_messages.server_info(self._transport.first_call(rpc, request))

    def upload(self, mesh: MeshLike) -> UploadedMesh:
        """Brings the mesh to the server, unless it has it, and returns its name:
        for a mesh that is matched many times. An upload that breaks off goes on
        where it was. InvalidInput: the mesh is wrong, see isomatch.mesh.as_mesh.
        """
        checked = as_mesh(mesh, "mesh")
        encoded = _draco.encode(checked.positions, checked.faces)
        return self._upload(encoded)

    def submit(
        self,
        x: MeshLike,
        y: MeshLike,
        *,
        landmarks: ArrayLike | None = None,
        landmarks_exact: bool = False,
        profile: str = "default",
        relation: str = "whole",
        scale: str = "auto",
        random_seed: int = 1,
        threads: int = 0,
        solved_vertices: int | None = None,
        memory_limit_bytes: int = 0,
        deadline: float | None = None,
        functional_map: bool = False,
        priority: int = 0,
        labels: Mapping[str, str] | None = None,
        queue_timeout: float | None = None,
        run_timeout: float | None = None,
        cancel_when_unwatched: bool = False,
    ) -> Job:
        """Starts a job and returns at once.

        x, y: (vertices n x 3, faces m x 3), a path, a mesh of trimesh, Open3D,
          meshio or PyVista, or what `upload` returned. Coordinates travel in
          single precision, near the origin. Vertices that lie side by side are
          not welded; `isomatch inspect --weld` tells what would be.
        landmarks: k x 2, known matches (vertex of x, vertex of y); those that the
          rest contradicts are changed, unless landmarks_exact.
        relation: "whole", "part-of-y" where x is a part of y, "part-of-x" where y is
          one of x, "overlap" where each lacks something of the other, "auto" to find
          that out; scale: of parts, "same" where both have one unit, as overlaps
          need, "auto" finds it out.
        profile: "default" or "paper". random_seed: same input and seed, same map.
        threads: 0 is the server's share. solved_vertices: larger meshes are
          decimated to about so many; 0 never; None as the profile says.
        memory_limit_bytes: the job takes no more, its meshes included: it uses
          fewer threads, then solves on fewer vertices (a warning of its result),
          or is refused; 0 for no limit but the server's.
        deadline: seconds the job may refine its map, from its start on: then the best
          there is becomes the result, the first whole one at least, as `ended_early`
          of ResultInfo says. Not with the profile "paper".
        functional_map: makes it, for result(functional_map=True).
        priority: -100 to 100. labels: at most 16, to find the job by.
        queue_timeout, run_timeout: seconds, after which the job fails.
        cancel_when_unwatched: the server cancels the job once nobody has watched
          it for ten seconds.

        InvalidInput, with `field`: something is wrong. ResourceExhausted: the
        queue is full, see `retry_after`. FailedPrecondition: it needs more memory
        than the server has, or a mesh that `upload` brought is gone (MESH_MISSING).
        """
        request = _requests.create_job(
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
            functional_map=functional_map,
            priority=priority,
            labels=labels,
            queue_timeout=queue_timeout,
            run_timeout=run_timeout,
            cancel_when_unwatched=cancel_when_unwatched,
        )
        uploaded = self._add_meshes(request, x, y)
        # With it a retry cannot start a second job.
        request.request_id = str(uuid.uuid4())
        created = _status_messages.job_status(self._create(request, uploaded))
        return Job(self._transport, created, (_mesh_or_none(x), _mesh_or_none(y)))

    def job(self, name: str) -> Job:
        """A job by its name, "jobs/..."; NotFound when the server has none."""
        request = _messages.GetJobRequest(name=name)
        response = self._transport.call(self._transport.rpcs.GetJob, request)
        return Job(self._transport, _status_messages.job_status(response.job))

    def jobs(
        self,
        *,
        states: Iterable[JobState] = (),
        labels: Mapping[str, str] | None = None,
        page_size: int = 100,
    ) -> Iterator[JobStatus]:
        """The newest first: those in one of `states` (any when empty) that have
        all of `labels`. Pages of 1 to 1000 are fetched as they are needed."""
        request = _messages.ListJobsRequest(
            page_size=page_size,
            states=[_messages.enum_number("Job.State", f"STATE_{s.value}") for s in states],
            labels=labels,
        )
        while True:
            page = self._transport.call(self._transport.rpcs.ListJobs, request)
            yield from map(_status_messages.job_status, page.jobs)
            if not page.next_page_token:
                return
            request.page_token = page.next_page_token

    def _limits(self) -> status.Limits:
        if self._known_limits is None:
            self._known_limits = self.info().limits
        return self._known_limits

    def _create(self, request: Any, uploaded: list[_draco.EncodedMesh]) -> Any:
        """A mesh may go between its upload and CreateJob: another client deletes the last
        job that named it, or its bytes are damaged, which shows when they are read. What
        we hold is brought once more."""
        rpc = self._transport.rpcs.CreateJob
        try:
            return self._transport.call(rpc, request).job
        except FailedPrecondition as error:
            if error.reason != "MESH_MISSING" or not uploaded:
                raise
        for mesh in uploaded:
            self._upload(mesh)
        return self._transport.call(rpc, request).job

    def _add_meshes(
        self, request: Any, x: MeshLike, y: MeshLike
    ) -> list[_draco.EncodedMesh]:
        """Inside the request if both fit, else by digest, the missing uploaded: these are
        returned."""
        uploaded: list[_draco.EncodedMesh] = []
        meshes: list[UploadedMesh | _draco.EncodedMesh] = []
        for value, field in ((x, "x"), (y, "y")):
            if isinstance(value, UploadedMesh):
                meshes.append(value)
            else:
                checked = as_mesh(value, field)
                meshes.append(_draco.encode(checked.positions, checked.faces))
        _requests.check_landmarks(request, meshes[0].vertices, meshes[1].vertices)
        size = request.ByteSize() + sum(
            len(mesh.data) for mesh in meshes if isinstance(mesh, _draco.EncodedMesh)
        )
        inline = size + _requests.OVERHEAD_BYTES <= self._limits().max_request_bytes
        for mesh, message in zip(meshes, (request.mesh_x, request.mesh_y)):
            if isinstance(mesh, _draco.EncodedMesh) and not inline:
                uploaded.append(mesh)
                mesh = self._upload(mesh)
            _requests.set_mesh(message, mesh)
        return uploaded

    def _upload(self, mesh: _draco.EncodedMesh) -> UploadedMesh:
        digest = _messages.Digest(
            sha256=hashlib.sha256(mesh.data).hexdigest(), size_bytes=len(mesh.data)
        )
        backoff = Backoff(self._transport.patience)
        before = 0
        while (received := self._find_received(digest)) is not None:
            if received > before:
                backoff.reset()
            before = received
            error = self._send_from(received, mesh.data, digest)
            if error is None:
                break
            # An idle upload goes on. What the server had may have expired since,
            # or be another's damage: then it is gone now, and we begin anew.
            again = error.code == "DEADLINE_EXCEEDED"
            again |= received > 0 and error.code == "INVALID_ARGUMENT"
            time.sleep(backoff.pause_after(Unavailable(str(error)) if again else error))
        return UploadedMesh(digest.sha256, digest.size_bytes, mesh.by_id, mesh.vertices)

    def _find_received(self, digest: Any) -> int | None:
        """Bytes of the mesh that the server has; None when it has them all."""
        request = _messages.FindMissingMeshesRequest(digests=[digest])
        found = self._transport.call(self._transport.rpcs.FindMissingMeshes, request)
        if not found.missing:
            return None
        return int(found.received_bytes[0]) if found.received_bytes else 0

    def _send_from(self, offset: int, data: bytes, digest: Any) -> IsomatchError | None:
        step = self._limits().max_chunk_bytes

        def messages() -> Iterator[Any]:
            yield _messages.UploadMeshRequest(header=digest, offset=offset)
            for at in range(offset, len(data), step):
                yield _messages.UploadMeshRequest(chunk=data[at : at + step])

        try:
            self._transport.rpcs.UploadMesh(messages(), metadata=self._transport.metadata)
        except grpc.RpcError as error:
            return from_rpc(error)
        return None


class Job:
    """A job on the server. Not thread-safe."""

    def __init__(
        self,
        transport: Transport,
        snapshot: JobStatus,
        meshes: tuple[Mesh | None, Mesh | None] = (None, None),
    ) -> None:
        """meshes: for a result that is viewed, where they are known."""
        self._transport = transport
        self._status = snapshot
        self._meshes = meshes

    def __repr__(self) -> str:
        return f"<isomatch.Job {self.name} {self._status.state.value}>"

    @property
    def name(self) -> str:
        """ "jobs/" and an opaque id, also for client.job(name) elsewhere."""
        return self._status.name

    @property
    def status(self) -> JobStatus:
        """The last snapshot that this object has seen."""
        return self._status

    def refresh(self) -> JobStatus:
        """Asks the server for a new snapshot."""
        request = _messages.GetJobRequest(name=self.name)
        response = self._transport.call(self._transport.rpcs.GetJob, request)
        return self._seen(response.job)

    def watch(self) -> Iterator[JobStatus]:
        """Snapshots as the job changes, from the present one to the terminal one.

        A lost stream goes on where it was. A slow reader skips snapshots, never
        the last. Unavailable: the server was away for longer than `patience`.
        """
        request = _messages.WatchJobRequest(name=self.name)
        backoff = Backoff(self._transport.patience)
        while True:
            call = self._transport.rpcs.WatchJob(request, metadata=self._transport.metadata)
            try:
                for response in call:
                    backoff.reset()
                    if response.job.sequence == request.after_sequence:
                        continue  # a heartbeat
                    request.after_sequence = response.job.sequence
                    yield self._seen(response.job)
                    if self._status.is_terminal:
                        return
                error: IsomatchError = Unavailable("the server ended the watch early")
            except grpc.RpcError as rpc:
                error = from_rpc(rpc)
            finally:
                call.cancel()
            time.sleep(backoff.pause_after(error))

    async def progress(self) -> AsyncIterator[JobStatus]:
        """As watch, for `async for` in the running event loop."""
        request = _messages.WatchJobRequest(name=self.name)
        backoff = Backoff(self._transport.patience)
        async with self._transport.aio_rpcs() as rpcs:
            while True:
                call = rpcs.WatchJob(request, metadata=self._transport.metadata)
                try:
                    async for response in call:
                        backoff.reset()
                        if response.job.sequence == request.after_sequence:
                            continue  # a heartbeat
                        request.after_sequence = response.job.sequence
                        yield self._seen(response.job)
                        if self._status.is_terminal:
                            return
                    error: IsomatchError = Unavailable("the server ended the watch early")
                except (grpc.RpcError, asyncio.CancelledError) as cause:
                    error = await rpc_error(call, cause)
                finally:
                    call.cancel()
                await asyncio.sleep(backoff.pause_after(error))

    def result(
        self,
        *,
        confidence: bool = True,
        precise: bool = False,
        alternative: bool = False,
        functional_map: bool = False,
        matched_y: bool = True,
        on_progress: OnProgress | None = None,
    ) -> MatchResult:
        """Waits for the job to end and downloads its result.

        The flags say what comes beside the map; on_progress is called with each
        snapshot meanwhile. JobFailed, JobCancelled: there is no result. DataLoss:
        it arrived damaged.
        """
        if not self._status.is_terminal:
            for snapshot in self.watch():
                if on_progress is not None:
                    on_progress(snapshot)
        failure = self._status.failure()
        if failure is not None:
            raise failure
        info = self._status.result
        assert info is not None
        wanted = {
            "confidence": confidence,
            "precise map": precise,
            "alternative map": alternative,
            "functional map": functional_map,
            "mask y": matched_y,
        }
        header, data = self._download("map")
        n, end = header.vertices_x, header.vertices_y
        parts = {
            name: _DECODERS[name](self._download(name)[1], n, end)
            for name, is_wanted in wanted.items()
            if is_wanted and name in info.parts
        }
        return MatchResult(
            y_from_x=_parts.decode_map(data, n, end),
            vertices_y=end,
            info=info,
            job=self.name,
            confidence=parts.get("confidence"),
            precise=parts.get("precise map"),
            alternative=parts.get("alternative map"),
            spectral=parts.get("functional map"),
            matched_y=parts.get("mask y"),
            meshes=self._meshes,
        )

    def cancel(self) -> JobStatus:
        """Asks the job to stop; one that has ended already stays as it is."""
        request = _messages.CancelJobRequest(name=self.name)
        try:
            response = self._transport.call(self._transport.rpcs.CancelJob, request)
        except FailedPrecondition as error:
            if error.reason != "JOB_TERMINAL":
                raise
            return self.refresh()
        return self._seen(response.job)

    def delete(self) -> None:
        """Forgets an ended job and its result. FailedPrecondition: it runs."""
        request = _messages.DeleteJobRequest(name=self.name)
        self._transport.call(self._transport.rpcs.DeleteJob, request)

    def _seen(self, message: Any) -> JobStatus:
        self._status = _status_messages.job_status(message)
        return self._status

    def _download(self, part: str) -> tuple[Any, bytes]:
        """The header, and the part's bytes, verified; goes on when it breaks off."""
        request = _messages.DownloadResultRequest(
            name=self.name, part=_requests.part_number(part)
        )
        header: Any = None
        data = bytearray()
        backoff = Backoff(self._transport.patience)
        while True:
            request.offset = len(data)
            rpc = self._transport.rpcs.DownloadResult
            try:
                for response in rpc(request, metadata=self._transport.metadata):
                    if response.HasField("header"):
                        header = response.header
                    else:
                        backoff.reset()
                        data += response.chunk
                break
            except grpc.RpcError as rpc_failure:
                error = from_rpc(rpc_failure)
            time.sleep(backoff.pause_after(error))
        self._verify(part, bytes(data), header.digest)
        return header, bytes(data)

    @staticmethod
    def _verify(part: str, data: bytes, digest: Any) -> None:
        if (
            len(data) != digest.size_bytes
            or hashlib.sha256(data).hexdigest() != digest.sha256
        ):
            raise DataLoss(
                f"the {part} arrived damaged: {len(data)} bytes, expected "
                f"{digest.size_bytes} with SHA-256 {digest.sha256}"
            )
