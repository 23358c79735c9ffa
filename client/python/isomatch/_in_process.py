"""Matching in this process, by libisomatch.so.0."""

from __future__ import annotations

import contextlib
import ctypes
import json
import math
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

from isomatch import _library
from isomatch._arrays import as_flags, copied
from isomatch._landmarks import checked_landmarks, integer
from isomatch.errors import InvalidType, invalid
from isomatch.mesh import Mesh, MeshLike, UploadedMesh, as_mesh
from isomatch.result import FunctionalMap, MatchResult, PreciseMap
from isomatch.status import (
    JobStatus,
    LandmarkOutcome,
    MeshSummary,
    Quality,
    ResultInfo,
    Scores,
    Verdict,
    running,
    succeeded,
)

OnStatus = Callable[[JobStatus], object]

_SNAPSHOT_SECONDS = 0.1

# What the library takes; it says itself what an option may be.
_LOW, _HIGH = -(2**63), 2**63 - 1


class PreparedMesh:
    """A mesh and what matching needs to know of it alone: `prepare` makes one, `match`
    takes it in place of a mesh, any number of times, by threads too."""

    def __init__(self, mesh: Mesh, shape: _library.Owned) -> None:
        self.mesh = mesh
        self._shape = shape

    def __reduce__(self) -> Any:
        raise TypeError("a PreparedMesh is of this process alone; prepare it in each")

    def __repr__(self) -> str:
        return f"<isomatch.PreparedMesh {self.mesh.name or self.mesh.num_vertices}>"

    @property
    def handle(self) -> ctypes.c_void_p:
        return self._shape.handle


class Options:
    """isomatch_options, of what the caller gives. InvalidInput names what is wrong."""

    def __init__(
        self,
        *,
        profile: str,
        relation: str = "whole",
        scale: str = "auto",
        **numbers: int | None,
    ) -> None:
        self._owned = _library.Owned("options", _library.load().isomatch_options_new())
        for field, text, known in (
            ("profile", profile, "'default' or 'paper'"),
            (
                "relation",
                relation,
                "'whole', 'part-of-y', 'part-of-x', 'overlap' or 'auto'",
            ),
            ("scale", scale, "'auto' or 'same'"),
        ):
            if not isinstance(text, str):
                raise invalid(field, f"is {text!r}, expected {known}")
            _library.call("options_set_text", self.handle, field.encode(), text.encode())
        for name, value in numbers.items():
            if value is not None:
                number = integer(name, value, _LOW, _HIGH)
                _library.call("options_set_integer", self.handle, name.encode(), number)

    @property
    def handle(self) -> ctypes.c_void_p:
        return self._owned.handle


class _Clock:
    """The seconds of stages, from what the library tells of its progress."""

    def __init__(self) -> None:
        self.start = self._last = time.monotonic()
        self._stage = ""
        self.seconds: dict[str, float] = {}

    def tell(self, stage: str) -> bool:
        """Whether another stage has begun."""
        now = time.monotonic()
        if self._stage:
            self.seconds[self._stage] = self.seconds.get(self._stage, 0) + now - self._last
        is_new = stage != self._stage
        self._stage, self._last = stage, now
        return is_new

    @property
    def run_seconds(self) -> float:
        return self._last - self.start


class _Work:
    """A call of the library in a thread of its own, so that the caller's may be
    interrupted. Whatever becomes of the caller, it holds what the library uses until
    that returns."""

    def __init__(self, call: Callable[[Any], None], held: Any, is_followed: bool) -> None:
        self._call: Any = call
        self._held, self._is_followed = held, is_followed
        self.events: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.clock = _Clock()
        self._told_at = 0.0
        self._cancel = _library.Owned("cancel", _library.load().isomatch_cancel_new())
        self._control: Any = _library.Control(
            _library.OnProgress(self._told), None, self._cancel.handle
        )
        self._ended = threading.Event()
        # Not of the caller's kind: Python ends only when it has.
        self._thread = threading.Thread(target=self._run, name="isomatch", daemon=False)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Cancels it and waits, however often that is interrupted."""
        self._cancel.get("request")
        while self._thread.ident is not None and not self._ended.is_set():
            with contextlib.suppress(KeyboardInterrupt):
                self._ended.wait()

    def _run(self) -> None:
        try:
            self._call(ctypes.byref(self._control))
            self.events.put(None)
        except BaseException as error:
            self.events.put(error)
        finally:
            self.clock.tell("")
            # They hold each other: this one, and the function that the library calls.
            self._call = self._held = self._control = None
            self._ended.set()

    def _told(self, _user: Any, stage: bytes, of_stage: float, of_all: float) -> int:
        """Of all that the library tells, who follows gets each stage, and some ten
        snapshots a second."""
        name = stage.decode()
        is_new = self.clock.tell(name)
        now = time.monotonic()
        if self._is_followed and (is_new or now - self._told_at >= _SNAPSHOT_SECONDS):
            self._told_at = now
            has_map = bool(self._cancel.get("has_map"))
            self.events.put((name, of_stage, of_all, has_map))
        return 0 if threading.main_thread().is_alive() else 1  # Python ends


def _run(call: Callable[[Any], None], held: Any, on_status: OnStatus | None) -> _Clock:
    """Calls `call(control)`, which uses `held`. on_status gets the newest snapshot in
    the caller's thread; what that raises, or an interrupt, cancels the call."""
    work = _Work(call, held, on_status is not None)
    try:
        work.start()
        event = work.events.get()
        while event is not None:
            if isinstance(event, BaseException):
                raise event
            assert on_status is not None
            if work.events.empty():  # else there is a newer one
                on_status(running(*event))
            event = work.events.get()
    except BaseException:
        work.stop()
        raise
    return work.clock


def prepare(
    mesh: MeshLike,
    *,
    profile: str = "default",
    threads: int = 0,
    solved_vertices: int | None = None,
    memory_limit_bytes: int = 0,
) -> PreparedMesh:
    """Does what matching does with one mesh alone, for one that is matched many times.

    >>> template = isomatch.prepare("template.ply")
    >>> maps = [isomatch.match(template, scan) for scan in scans]

    The options are those of `match`, which has to get the same; the maps are then those
    of the meshes. Errors: as match.
    """
    checked = as_mesh(mesh, "mesh")
    options = Options(
        profile=profile,
        threads=threads,
        memory_limit_bytes=memory_limit_bytes,
        solved_vertices=solved_vertices,
    )
    shape = _library.Owned("shape")
    borrowed = checked.borrowed()

    def call(control: Any) -> None:
        _library.call("prepare", ctypes.byref(borrowed), options.handle, control, shape.out)

    _run(call, (checked, borrowed, options, shape), None)
    return PreparedMesh(checked, shape)


def _side(value: Any, field: str) -> tuple[Mesh, Any, Any]:
    """The mesh, and what of it the library gets: itself or its shape."""
    if isinstance(value, UploadedMesh):
        raise InvalidType(
            f"{field}: is on a server, expected server= beside it",
            reason="INVALID_FIELD",
            field=field,
        )
    if isinstance(value, PreparedMesh):
        return value.mesh, None, value.handle
    mesh = as_mesh(value, field)
    return mesh, ctypes.pointer(mesh.borrowed()), None


def match(
    x: Any,
    y: Any,
    *,
    landmarks: Any,
    options: Options,
    on_status: OnStatus | None,
    wanted: dict[str, bool],
) -> MatchResult:
    """isomatch.match without a server; `wanted` has the flags of its results."""
    mesh_x, borrowed_x, shape_x = _side(x, "x")
    mesh_y, borrowed_y, shape_y = _side(y, "y")
    pairs = checked_landmarks(landmarks, mesh_x.num_vertices, mesh_y.num_vertices)
    known = (_library.Landmark * len(pairs))(*(_library.Landmark(*xy) for xy in pairs))
    pair = _library.Pair(borrowed_x, shape_x, borrowed_y, shape_y, known, len(pairs))
    found = _library.Owned("result")

    def call(control: Any) -> None:
        _library.call("match", ctypes.byref(pair), options.handle, control, found.out)

    clock = _run(call, (x, y, mesh_x, mesh_y, pair, known, options, found), on_status)
    result = _result_of(found, (mesh_x, mesh_y), clock, wanted)
    if on_status is not None:
        on_status(succeeded(result.info))
    return result


def _result_of(
    found: _library.Owned, meshes: tuple[Mesh, Mesh], clock: _Clock, wanted: dict[str, bool]
) -> MatchResult:
    n = found.get("num_vertices")
    parts: dict[str, Any] = {}
    if wanted["confidence"]:
        parts["confidence"] = copied(found.get("confidence"), n)
    if wanted["matched_y"]:
        parts["matched_y"] = as_flags(copied(found.get("mask_y"), meshes[1].num_vertices))
    if wanted["precise"]:
        parts["precise"] = PreciseMap(
            copied(found.get("precise_vertices"), n, 3),
            copied(found.get("precise_weights"), n, 3),
        )
    if wanted["alternative"] and found.get("num_alternatives") > 0:
        parts["alternative"] = copied(found.get("alternative", 0), n)
    if wanted["functional_map"]:
        k = found.get("functional_map_size")
        parts["spectral"] = FunctionalMap(
            copied(found.get("eigenvalues_x"), k),
            copied(found.get("eigenvalues_y"), k),
            copied(found.get("functional_map"), k, k),
        )
    names = {"precise": "precise map", "alternative": "alternative map"}
    names |= {"spectral": "functional map", "matched_y": "mask y"}
    there = ("map", *(names.get(name, name) for name in parts))
    return MatchResult(
        y_from_x=copied(found.get("map"), n),
        vertices_y=meshes[1].num_vertices,
        info=_info(json.loads(found.get("report")), clock, there),
        meshes=meshes,
        **parts,
    )


def _peak_resident_bytes() -> int:
    """Of this process; the library is for Linux alone."""
    import resource

    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _numbers(fields: dict[str, Any]) -> dict[str, Any]:
    """null as not a number."""
    return {name: math.nan if value is None else value for name, value in fields.items()}


def _scores(fields: dict[str, Any]) -> Scores:
    return Scores(**_numbers(fields))


def _info(report: dict[str, Any], clock: _Clock, parts: tuple[str, ...]) -> ResultInfo:
    def of(prefix: str) -> tuple[str, ...]:
        return tuple(
            text[len(prefix) :] for text in report["warnings"] if text.startswith(prefix)
        )

    def summary(side: str) -> MeshSummary:
        return MeshSummary(**_numbers(report[f"mesh_{side}"]), warnings=of(f"{side.upper()}: "))

    others = (text for text in report["warnings"] if not text.startswith(("X: ", "Y: ")))
    return ResultInfo(
        mesh_x=summary("x"),
        mesh_y=summary("y"),
        verdict=Verdict(**report["verdict"]),
        scores=_scores(report["scores"]),
        quality=Quality(**_numbers(report["quality"])),
        symmetry_confidence=report["symmetry_confidence"],
        ended_early=report["ended_early"],
        alternatives=tuple(_scores(entry["scores"]) for entry in report["alternatives"]),
        landmarks=tuple(LandmarkOutcome(**_numbers(entry)) for entry in report["landmarks"]),
        unmatched=report["unmatched"],
        objective=report["objective"],
        stage_seconds=clock.seconds,
        run_seconds=clock.run_seconds,
        peak_resident_bytes=_peak_resident_bytes(),
        warnings=tuple(others),
        profile=report["profile"],
        relation=report["relation"],
        relation_confidence=report["relation_confidence"],
        scale=report["scale"],
        random_seed=report["random_seed"],
        parts=parts,
    )
