"""A bar of tqdm for what takes longer than a second."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

from isomatch import _page
from isomatch.errors import invalid

_DELAY_SECONDS = 1.0
_FORMAT = "{desc}: {percentage:3.0f}% |{bar}| {elapsed}"


class _Bar:
    """Comes after a second; until then nothing is imported."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._bar: Any = None

    def __call__(self, status: Any) -> None:
        if self._bar is None:
            if time.monotonic() - self._start < _DELAY_SECONDS:
                return
            self._bar = self._make()
        self._bar.set_description_str(status.stage, refresh=False)
        self._bar.n = status.total_fraction
        self._bar.refresh()

    def _make(self) -> Any:
        from tqdm.auto import tqdm

        return tqdm(total=1.0, bar_format=_FORMAT, file=sys.stderr)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _has_tqdm() -> bool:
    import importlib.util

    return importlib.util.find_spec("tqdm") is not None


def _is_watched() -> bool:
    return _page.in_notebook() or (sys.stderr is not None and sys.stderr.isatty())


@contextlib.contextmanager
def followed(
    progress: bool | None, on_progress: Callable[[Any], object] | None
) -> Iterator[Callable[[Any], None] | None]:
    """What is to be called with each JobStatus; None for nothing.

    progress: a bar; None where tqdm is installed and a person watches. InvalidInput:
    it is True, and there is no tqdm.
    """
    if progress is None:
        progress = on_progress is None and _is_watched() and _has_tqdm()
    elif progress and not _has_tqdm():
        raise invalid("progress", "is True, expected tqdm to be installed")
    bar = _Bar() if progress else None
    calls = [call for call in (bar, on_progress) if call is not None]

    def call_all(status: Any) -> None:
        for call in calls:
            call(status)

    try:
        yield call_all if calls else None
    finally:
        if bar is not None:
            bar.close()
