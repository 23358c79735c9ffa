"""Reads OFF, OBJ, PLY and STL files; vertices keep the file's number and order."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isomatch._stl_file import read_stl
from isomatch._triangulation import triangulate
from isomatch.errors import InvalidInput

Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


def _content_lines(text: str) -> Iterator[list[str]]:
    """The words of each line that has some, without comments."""
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if words:
            yield words


def _read_off(data: bytes) -> Arrays:
    lines = _content_lines(data.decode("utf-8", "replace"))
    header = next(lines, [""])
    if header[0] != "OFF":
        raise ValueError(f"it begins with '{header[0]}', expected OFF")
    counts = header[1:] or next(lines)
    n, m = int(counts[0]), int(counts[1])
    rows = list(lines)
    if len(rows) < n + m:
        raise ValueError(f"{len(rows)} lines, expected {n} vertices and {m} faces")
    vertices = np.array([row[:3] for row in rows[:n]], dtype=np.float64)
    faces = ([int(w) for w in row[1 : 1 + int(row[0])]] for row in rows[n : n + m])
    return vertices.reshape(-1, 3), triangulate(faces, vertices)


def _obj_statements(text: str) -> Iterator[list[str]]:
    """As _content_lines; a line that ends with a backslash goes on in the next."""
    begun: list[str] = []
    for line in text.splitlines():
        content = line.partition("#")[0].rstrip()
        begun += content.removesuffix("\\").split()
        if not content.endswith("\\"):
            if begun:
                yield begun
            begun = []
    if begun:
        yield begun


def _obj_corner(word: str, vertices: int) -> int:
    """Of V, V/VT, V//VN or V/VT/VN, numbered from 1, or from the end when negative."""
    number = int(word.partition("/")[0])
    if number == 0 or number < -vertices:
        raise ValueError(f"a face names vertex {number}, expected from 1, or -{vertices} on")
    return number - 1 if number > 0 else vertices + number


def _read_obj(data: bytes) -> Arrays:
    """Points and lines, which are no part of the surface, are passed over."""
    vertices: list[list[str]] = []
    polygons: list[list[int]] = []
    for words in _obj_statements(data.decode("utf-8", "replace")):
        if words[0] == "v":
            vertices.append(words[1:4])
        elif words[0] == "f":
            polygons.append([_obj_corner(word, len(vertices)) for word in words[1:]])
    positions = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return positions, triangulate(polygons, positions)


class _PlyElement:
    """One element of a header: its properties are (name, type, list length)."""

    def __init__(self, name: str, count: int) -> None:
        self.name = name
        self.count = count
        self.properties: list[tuple[str, str, str | None]] = []

    def index(self, *names: str) -> int:
        for i, (name, _, _) in enumerate(self.properties):
            if name in names:
                return i
        raise ValueError(f"element {self.name} has no property {' or '.join(names)}")


def _ply_header(text: str) -> tuple[str, list[_PlyElement]]:
    """Returns the format and the elements."""
    form = ""
    elements: list[_PlyElement] = []
    for words in map(str.split, text.splitlines()):
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append(_PlyElement(words[1], int(words[2])))
        elif words[:2] == ["property", "list"]:
            length, entry = _PLY_TYPES[words[2]], _PLY_TYPES[words[3]]
            elements[-1].properties.append((words[4], entry, length))
        elif words[:1] == ["property"]:
            elements[-1].properties.append((words[2], _PLY_TYPES[words[1]], None))
    return form, elements


Rows = list[list[list[float]]]


def _ascii_rows(element: _PlyElement, lines: Iterator[list[str]]) -> Rows:
    """For each row the values of each property."""
    rows: Rows = []
    for _ in range(element.count):
        words = iter(next(lines))
        row = []
        for _, _, length in element.properties:
            size = 1 if length is None else int(next(words))
            row.append([float(next(words)) for _ in range(size)])
        rows.append(row)
    return rows


class _Binary:
    def __init__(self, data: bytes, order: str) -> None:
        self.data = data
        self.order = order
        self.offset = 0

    def take(self, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
        values: NDArray[Any] = np.frombuffer(self.data, dtype, count, self.offset)
        self.offset += values.nbytes
        return values

    def table(self, element: _PlyElement, sizes: list[int]) -> NDArray[Any] | None:
        """The element's rows if its lists all have these sizes, else None."""
        fields: list[tuple[str, str, tuple[int, ...]]] = []
        for i, (_, kind, length) in enumerate(element.properties):
            if length is not None:
                fields.append((f"n{i}", self.order + length, ()))
            fields.append((f"v{i}", self.order + kind, (sizes[i],)))
        dtype: np.dtype[Any] = np.dtype(fields)
        if len(self.data) - self.offset < dtype.itemsize * element.count:
            return None
        start = self.offset
        table = self.take(dtype, element.count)
        for i, (_, _, length) in enumerate(element.properties):
            if length is not None and not (table[f"n{i}"] == sizes[i]).all():
                self.offset = start
                return None
        return table

    def rows(self, element: _PlyElement) -> Rows:
        rows: Rows = []
        for _ in range(element.count):
            row = []
            for _, kind, length in element.properties:
                size = 1
                if length is not None:
                    size = int(self.take(np.dtype(self.order + length), 1)[0])
                row.append(self.take(np.dtype(self.order + kind), size).tolist())
            rows.append(row)
        return rows


def _columns(element: _PlyElement, source: _Binary | Iterator[list[str]]) -> list[Any]:
    """Of each property its values, row by row: scalars as rows of one."""
    if isinstance(source, _Binary):
        # Nearly every file has triangles only, and so rows of one size.
        table = source.table(element, [1 if p[2] is None else 3 for p in element.properties])
        if table is not None:
            return [table[f"v{i}"] for i in range(len(element.properties))]
        rows = source.rows(element)
    else:
        rows = _ascii_rows(element, source)
    return [list(column) for column in zip(*rows)]


def _read_ply(data: bytes) -> Arrays:
    head, mark, rest = data.partition(b"end_header")
    if not data.startswith(b"ply") or not mark:
        raise ValueError("it has no PLY header, expected `ply` to `end_header`")
    form, elements = _ply_header(head.decode("ascii", "replace"))
    rest = rest[rest.index(b"\n") + 1 :]
    source: _Binary | Iterator[list[str]]
    if form == "ascii":
        source = _content_lines(rest.decode("ascii", "replace"))
    else:
        source = _Binary(rest, {"binary_little_endian": "<", "binary_big_endian": ">"}[form])
    vertices = np.empty((0, 3))
    faces: NDArray[np.int64] = np.empty((0, 3), dtype=np.int64)
    for element in elements:
        columns = _columns(element, source)
        if element.name == "vertex":
            axes = [np.asarray(columns[element.index(axis)]) for axis in "xyz"]
            vertices = np.hstack(axes).astype(np.float64)
        elif element.name == "face":
            polygons = columns[element.index("vertex_indices", "vertex_index")]
            if isinstance(polygons, np.ndarray):
                faces = polygons.astype(np.int64)
            else:
                faces = triangulate([[int(c) for c in p] for p in polygons], vertices)
    return vertices, faces


_READERS = {".off": _read_off, ".obj": _read_obj, ".ply": _read_ply, ".stl": read_stl}


def read_mesh(path: str | os.PathLike[str], field: str) -> Arrays:
    """Returns vertices (n x 3) and faces (m x 3).

    Quadrilaterals are cut along their shorter diagonal, larger polygons into a
    fan. InvalidInput, with `field`: another extension, or a damaged file.
    OSError: the file cannot be opened.
    """
    file = pathlib.Path(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        message = f"the extension is '{file.suffix}', expected .off, .obj, .ply or .stl"
    else:
        try:
            return reader(file.read_bytes())
        except (ValueError, KeyError, IndexError, StopIteration, OverflowError) as error:
            message = f"not a mesh that can be read to its end: {error}"
    raise InvalidInput(f"{field}: '{path}': {message}", reason="INVALID_FIELD", field=field)
