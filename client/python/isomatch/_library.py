"""libisomatch.so.0 by ctypes: the functions of isomatch.h, and their errors."""

from __future__ import annotations

import ctypes
import functools
import os
import pathlib
from collections.abc import Callable
from ctypes import (
    CFUNCTYPE,
    POINTER,
    Structure,
    byref,
    c_char_p,
    c_double,
    c_float,
    c_int,
    c_int32,
    c_int64,
    c_uint8,
    c_void_p,
)
from typing import Any

from isomatch.errors import (
    InvalidInput,
    IsomatchError,
    JobCancelled,
    JobFailed,
    LibraryNotFound,
    ResourceExhausted,
    in_our_words,
)

_NAME = "libisomatch.so.0"


class Mesh(Structure):
    """isomatch_mesh; whoever makes one keeps its arrays."""

    _fields_ = [
        ("positions", c_void_p),
        ("num_vertices", c_int64),
        ("faces", c_void_p),
        ("num_faces", c_int64),
    ]


class Landmark(Structure):
    _fields_ = [("x", c_int32), ("y", c_int32)]


#: isomatch_control.progress
OnProgress = CFUNCTYPE(c_int, c_void_p, c_char_p, c_double, c_double)


class Control(Structure):
    _fields_ = [("progress", OnProgress), ("user", c_void_p), ("cancel", c_void_p)]


class Pair(Structure):
    _fields_ = [
        ("mesh_x", POINTER(Mesh)),
        ("shape_x", c_void_p),
        ("mesh_y", POINTER(Mesh)),
        ("shape_y", c_void_p),
        ("landmarks", POINTER(Landmark)),
        ("num_landmarks", c_int64),
    ]


class MappedPair(Structure):
    _fields_ = [
        ("mesh_x", POINTER(Mesh)),
        ("mesh_y", POINTER(Mesh)),
        ("map", c_void_p),
        ("precise_vertices", c_void_p),
        ("precise_weights", c_void_p),
    ]


class Page(Structure):
    _fields_ = [
        ("title", c_char_p),
        ("name_x", c_char_p),
        ("name_y", c_char_p),
        ("confidence", c_void_p),
        ("report", c_char_p),
    ]


_OUT = POINTER(c_void_p)

# What functions return and take beside a last `isomatch_error** error`.
_FAILING: dict[str, list[Any]] = {
    "options_set_integer": [c_void_p, c_char_p, c_int64],
    "options_set_text": [c_void_p, c_char_p, c_char_p],
    "prepare": [POINTER(Mesh), c_void_p, POINTER(Control), _OUT],
    "match": [POINTER(Pair), c_void_p, POINTER(Control), _OUT],
    "mesh_file_read": [c_char_p, _OUT],
    "page_make_masked": [POINTER(MappedPair), POINTER(Page), c_void_p, _OUT],
    "carry_texture": [POINTER(MappedPair), c_void_p, c_void_p],
}

# What the others return; they take one object, two of them a number, too.
_PLAIN: dict[str, Any] = {
    "version": c_char_p,
    "error_status": c_int,
    "error_message": c_char_p,
    "error_field": c_char_p,
    "options_new": c_void_p,
    "cancel_new": c_void_p,
    "cancel_request": None,
    "cancel_has_map": c_int,
    "result_num_vertices": c_int64,
    "result_map": POINTER(c_int32),
    "result_confidence": POINTER(c_float),
    "result_mask_y": POINTER(c_uint8),
    "result_precise_vertices": POINTER(c_int32),
    "result_precise_weights": POINTER(c_double),
    "result_num_alternatives": c_int64,
    "result_alternative": POINTER(c_int32),
    "result_report": c_char_p,
    "result_functional_map_size": c_int64,
    "result_functional_map": POINTER(c_double),
    "result_eigenvalues_x": POINTER(c_double),
    "result_eigenvalues_y": POINTER(c_double),
    "mesh_file_mesh": POINTER(Mesh),
    "text_data": c_void_p,
    "text_size": c_int64,
}
_FREED = ("error", "options", "cancel", "shape", "result", "mesh_file", "text")
_WITHOUT_ARGUMENT = ("version", "options_new", "cancel_new")


def _declare(library: ctypes.CDLL) -> None:
    for name, arguments in _FAILING.items():
        function = getattr(library, f"isomatch_{name}")
        function.restype, function.argtypes = c_int, [*arguments, _OUT]
    for name, returned in _PLAIN.items():
        function = getattr(library, f"isomatch_{name}")
        function.restype = returned
        function.argtypes = [] if name in _WITHOUT_ARGUMENT else [c_void_p]
    library.isomatch_result_alternative.argtypes = [c_void_p, c_int64]
    for name in _FREED:
        function = getattr(library, f"isomatch_{name}_free")
        function.restype, function.argtypes = None, [c_void_p]


@functools.lru_cache(maxsize=None)
def load() -> ctypes.CDLL:
    """The library, loaded once: of ISOMATCH_LIBRARY, else the wheel's own, else the
    system's. LibraryNotFound when there is none, or one of another release."""
    named = os.environ.get("ISOMATCH_LIBRARY")
    bundled = pathlib.Path(__file__).parent / "lib" / _NAME
    path = named or (str(bundled) if bundled.exists() else _NAME)
    try:
        library = ctypes.CDLL(path)
        _declare(library)
    except (OSError, AttributeError) as error:
        raise LibraryNotFound(
            f"{path}: {error}; expected the wheel of Isomatch, the package libisomatch0, "
            "or the library's path in ISOMATCH_LIBRARY; with server=HOST:PORT it is not "
            "needed"
        ) from None
    return library


_STATUS_ERRORS: dict[int, Callable[..., IsomatchError]] = {
    1: functools.partial(InvalidInput, reason="INVALID_FIELD"),
    2: functools.partial(JobCancelled, reason="JOB_CANCELLED"),
    3: functools.partial(ResourceExhausted, reason="OUT_OF_MEMORY"),
    4: functools.partial(JobFailed, code="INTERNAL", reason="INTERNAL"),
}

def call(name: str, *arguments: Any) -> None:
    """Calls isomatch_NAME; what it fails with is raised, fields by the names they have
    in this package."""
    library = load()
    error = c_void_p()
    status = getattr(library, f"isomatch_{name}")(*arguments, byref(error))
    if status == 0:
        return
    try:
        message = library.isomatch_error_message(error).decode("utf-8", "replace")
        field = library.isomatch_error_field(error).decode()
    finally:
        library.isomatch_error_free(error)
    if field:
        message, field = in_our_words(message, field)
    raise _STATUS_ERRORS[status](message, field=field or None)


class Owned:
    """An object of the library, given back to it when nobody holds this any more."""

    def __init__(self, kind: str, handle: c_void_p | int | None = None) -> None:
        self._kind = kind
        self.handle = c_void_p() if handle is None else c_void_p(_value(handle))
        self._free = getattr(load(), f"isomatch_{kind}_free")

    def __del__(self) -> None:
        if getattr(self, "_free", None) is not None:
            self._free(self.handle)

    def get(self, name: str, *arguments: Any) -> Any:
        """isomatch_KIND_NAME of it."""
        return getattr(load(), f"isomatch_{self._kind}_{name}")(self.handle, *arguments)

    @property
    def out(self) -> Any:
        """Where a function puts it."""
        return byref(self.handle)


def _value(handle: c_void_p | int) -> int | None:
    return handle.value if isinstance(handle, c_void_p) else handle
