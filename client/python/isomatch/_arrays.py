"""Arrays as the library takes and gives them: of numpy, or lists where it is not."""

from __future__ import annotations

import ctypes
from array import array
from typing import Any

from isomatch._numpy import np


def address(values: Any) -> int:
    """Of the first number; `values` is a contiguous array of numpy, or an array."""
    if isinstance(values, array):
        return values.buffer_info()[0]
    return int(values.ctypes.data)


def contiguous(values: Any, code: str) -> Any:
    """Any nesting of numbers as one block: "d" of float64, "f" of float32, "i" of
    int32, "B" of bytes."""
    if np is not None:
        kind = {"d": np.float64, "f": np.float32, "i": np.int32, "B": np.uint8}[code]
        return np.ascontiguousarray(values, dtype=kind)
    if isinstance(values, array) and values.typecode == code:
        return values
    return array(code, _flat(values))


def _flat(values: Any) -> list[Any]:
    if len(values) > 0 and hasattr(values[0], "__len__"):
        return [number for row in values for number in _flat(row)]
    return list(values)


def copied(pointer: Any, count: int, columns: int = 1) -> Any:
    """What a pointer of ctypes leads to: `count` numbers, or rows of `columns`."""
    if count == 0:
        flat: Any = []
    else:
        kind = pointer._type_ * (count * columns)
        flat = kind.from_address(ctypes.cast(pointer, ctypes.c_void_p).value)
    if np is not None:
        numbers = np.array(flat, dtype=pointer._type_)
        return numbers if columns == 1 else numbers.reshape(count, columns)
    if columns == 1:
        return list(flat)
    return [list(flat[i : i + columns]) for i in range(0, count * columns, columns)]


def as_flags(numbers: Any) -> Any:
    """True where a number is not 0."""
    return [number != 0 for number in numbers] if np is None else numbers != 0
