"""Reads OFF, OBJ, PLY and STL files; vertices keep the file's number and order."""

from __future__ import annotations

import math
import os
import pathlib
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isomatch._lines import Lines, coordinate, items, place, read_lines, whole
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


def _off_polygon(words: list[str]) -> list[int]:
    """After the number of corners; colors may follow."""
    corners = [whole(word) for word in words[1 : 1 + max(0, whole(words[0]))]]
    if len(corners) < 3 or len(corners) != int(words[0]):
        raise ValueError(f"it has {len(corners)} corners of {words[0]}, expected 3 or more")
    return corners


def _read_off_lines(lines: Lines) -> Arrays:
    header = lines.next()
    if header[0] != "OFF":
        raise ValueError(f"it begins with '{header[0]}', expected OFF")
    counts = header[1:] or lines.next()
    if len(counts) < 2:
        raise ValueError(f"{len(counts)} counts, expected those of vertices and faces")
    n, m = whole(counts[0]), whole(counts[1])
    vertices = np.array(items("vertex", n, lambda: place(lines.next()))).reshape(-1, 3)
    return vertices, triangulate(items("face", m, lambda: _off_polygon(lines.next())), vertices)


def _read_off(data: bytes) -> Arrays:
    return read_lines(Lines(data), _read_off_lines)


def _obj_statement(lines: Lines) -> list[str] | None:
    """The words of one; a line that ends with a backslash goes on in the next. None at
    the end."""
    words = lines.row()
    while words and words[-1].endswith("\\"):
        words += [words.pop()[:-1], *(lines.row() or [""])]
    return words and [word for word in words if word]


# V, V/VT, V//VN or V/VT/VN.
_OBJ_CORNER = re.compile(r"([+-]?\d+)(/([+-]?\d+)?){0,2}", re.ASCII)


def _obj_corner(word: str, vertices: int) -> int:
    """Numbered from 1, or from the end when negative."""
    found = _OBJ_CORNER.fullmatch(word)
    number = int(found.group(1)) if found else 0
    if number == 0 or number < -vertices:
        raise ValueError(
            f"a face's corner is '{word}', expected V, V/VT, V//VN or V/VT/VN with V from "
            f"1, or from {-vertices} to -1 to count back"
        )
    return number - 1 if number > 0 else vertices + number


def _read_obj_lines(lines: Lines) -> Arrays:
    """Points and lines, which are no part of the surface, are passed over."""
    vertices: list[list[float]] = []
    polygons: list[list[int]] = []
    while (words := _obj_statement(lines)) is not None:
        if words[:1] == ["v"]:
            vertices.append(place(words[1:]))
        elif words[:1] == ["f"]:
            if len(words) < 4:
                raise ValueError(f"a face has {len(words) - 1} corners, expected 3 or more")
            polygons.append([_obj_corner(word, len(vertices)) for word in words[1:]])
    positions = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return positions, triangulate(polygons, positions)


def _read_obj(data: bytes) -> Arrays:
    return read_lines(Lines(data), _read_obj_lines)


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
            elements.append(_PlyElement(words[1], whole(words[2])))
        elif words[:2] == ["property", "list"]:
            length, entry = _PLY_TYPES[words[2]], _PLY_TYPES[words[3]]
            elements[-1].properties.append((words[4], entry, length))
        elif words[:1] == ["property"]:
            elements[-1].properties.append((words[2], _PLY_TYPES[words[1]], None))
    return form, elements


Rows = list[list[list[float]]]


def _ascii_row(element: _PlyElement, line: list[str]) -> list[list[float]]:
    """The values of each property."""
    words = iter(line)

    def number() -> float:
        word = next(words, "")
        # Of normals.
        return math.nan if word.lower().strip("+-")[:3] in ("nan", "inf") else coordinate(word)

    row = []
    for name, _, length in element.properties:
        size = 1 if length is None else whole(next(words, ""))
        if size < 0:
            raise ValueError(f"{name} has {size} entries")
        row.append([number() for _ in range(size)])
    return row


def _ascii_rows(element: _PlyElement, lines: Lines) -> Rows:
    return items(element.name, element.count, lambda: _ascii_row(element, lines.next()))


class _Binary:
    def __init__(self, data: bytes, order: str) -> None:
        self.data = data
        self.order = order
        self.offset = 0

    def take(self, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
        if count < 0:  # to numpy all that is left
            raise ValueError(f"a list has {count} entries")
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


def _columns(element: _PlyElement, source: _Binary | Lines) -> list[Any]:
    """Of each property its values, row by row: scalars as rows of one."""
    if isinstance(source, _Binary):
        # Nearly every file has triangles only, and so rows of one size.
        table = source.table(element, [1 if p[2] is None else 3 for p in element.properties])
        if table is not None:
            return [table[f"v{i}"] for i in range(len(element.properties))]
        rows = source.rows(element)
    else:
        rows = read_lines(source, lambda lines: _ascii_rows(element, lines))
    return [list(column) for column in zip(*rows)]


def _corners(values: list[float]) -> list[int]:
    corners = [int(value) for value in values]
    if corners != values:
        raise ValueError(f"a face is {values}, expected whole numbers")
    return corners


def _read_ply(data: bytes) -> Arrays:
    head, mark, rest = data.partition(b"end_header")
    if not data.startswith(b"ply") or not mark:
        raise ValueError("it has no PLY header, expected `ply` to `end_header`")
    form, elements = _ply_header(head.decode("ascii", "replace"))
    rest = rest[rest.index(b"\n") + 1 :]
    source: _Binary | Lines
    if form == "ascii":
        source = Lines(rest, head.count(b"\n") + 1)
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
                if not (faces == polygons).all():
                    raise ValueError("a corner is no whole number")
            else:
                faces = triangulate([_corners(p) for p in polygons], vertices)
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
        except (ValueError, KeyError, IndexError, OverflowError) as error:
            message = f"not a mesh that can be read to its end: {error}"
    raise InvalidInput(f"{field}: '{path}': {message}", reason="INVALID_FIELD", field=field)
