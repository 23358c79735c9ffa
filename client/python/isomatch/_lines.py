"""The lines of files that are text, and the numbers in them."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from typing import TypeVar

_T = TypeVar("_T")

# float() and int() take more: 1_0, infinity, digits of other scripts.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d+", re.ASCII)


class Lines:
    """The lines of a text; `number` is that of the last one that was taken."""

    def __init__(self, data: bytes, number: int = 0) -> None:
        # With a byte order mark the first word would be another one.
        self._text = io.StringIO(data.decode("utf-8-sig", "replace"), newline=None)
        self.number = number

    def row(self) -> list[str] | None:
        """The words of the next line, without a comment; None after the last."""
        line = self._text.readline()
        if not line:
            return None
        self.number += 1
        return line.partition("#")[0].split()

    def next(self) -> list[str]:
        """Of the next line that has some."""
        while (words := self.row()) is not None:
            if words:
                return words
        raise ValueError("the file ends")


def read_lines(lines: Lines, read: Callable[[Lines], _T]) -> _T:
    """What `read` makes of them; what is wrong there is told with its line."""
    try:
        return read(lines)
    except ValueError as error:
        raise ValueError(f"line {lines.number}: {error}") from None


def items(kind: str, count: int, read: Callable[[], _T]) -> list[_T]:
    """As many as a header announced; what is wrong is told with its number."""
    found: list[_T] = []
    try:
        for _ in range(count):
            found.append(read())
    except ValueError as error:
        raise ValueError(f"{kind} {len(found)} (0-based) of {count}: {error}") from None
    return found


def coordinate(word: str) -> float:
    if not _NUMBER.fullmatch(word):
        raise ValueError(f"a coordinate is '{word}', expected a finite number")
    return float(word)


def place(words: Sequence[str]) -> list[float]:
    """Three coordinates; what follows, colors for one, is not read."""
    if len(words) < 3:
        raise ValueError(f"a vertex has {len(words)} coordinates, expected 3")
    return [coordinate(word) for word in words[:3]]


def whole(word: str) -> int:
    if not _WHOLE.fullmatch(word):
        raise ValueError(f"'{word}' where a whole number is expected")
    return int(word)
