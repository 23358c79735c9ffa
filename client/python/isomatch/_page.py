"""The page that shows a result, made by the library; where it is shown."""

from __future__ import annotations

import ctypes
import json
import os
import pathlib
import sys
from typing import TYPE_CHECKING, Any

from isomatch import _library
from isomatch._arrays import address, contiguous
from isomatch._numpy import np
from isomatch.errors import invalid

if TYPE_CHECKING:
    from isomatch.mesh import Mesh
    from isomatch.result import MatchResult

# A notebook keeps what it shows.
_MOST_INLINE_BYTES = 24_000_000


class _Mapped:
    """A result and its meshes as the library takes them; keeps what that points to."""

    def __init__(self, result: MatchResult, x: Mesh, y: Mesh) -> None:
        precise = result.precise
        self._kept: list[Any] = [
            contiguous(result.y_from_x, "i"),
            precise and contiguous(precise.vertices, "i"),
            precise and contiguous(precise.weights, "d"),
        ]
        self._meshes = x, y, x.borrowed(), y.borrowed()
        self.pair = _library.MappedPair(
            ctypes.pointer(self._meshes[2]),
            ctypes.pointer(self._meshes[3]),
            *(None if values is None else address(values) for values in self._kept),
        )


def _bytes(field: str, text: str) -> bytes:
    """As the library takes a text; names of files need not be UTF-8."""
    if not isinstance(text, str):
        raise invalid(field, f"is {text!r}, expected a text")
    return text.replace("\0", "").encode("utf-8", "replace")


def make(result: MatchResult, x: Mesh, y: Mesh, title: str | None) -> str:
    """Returns the HTML document."""
    mapped = _Mapped(result, x, y)
    confidence = None if result.confidence is None else contiguous(result.confidence, "f")
    mask = None if result.matched_y is None else contiguous(result.matched_y, "B")
    page = _library.Page(
        None if title is None else _bytes("title", title),
        _bytes("x", x.name or "X"),
        _bytes("y", y.name or "Y"),
        None if confidence is None else address(confidence),
        json.dumps(result.report()).encode(),
    )
    text = _library.Owned("text")
    flags = None if mask is None else address(mask)
    _library.call(
        "page_make_masked", ctypes.byref(mapped.pair), ctypes.byref(page), flags, text.out
    )
    return ctypes.string_at(text.get("data"), text.get("size")).decode()


def carry_texture(result: MatchResult, x: Mesh, y: Mesh, uv_y: Any) -> Any:
    """MatchResult.transfer_texture."""
    if np is None:
        raise invalid("uv_y", "is of use with numpy only, expected it to be installed")
    try:
        values = np.asarray(uv_y, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise invalid("uv_y", f"{error}, expected numbers") from None
    if values.shape != (y.num_faces, 3, 2):
        raise invalid("uv_y", f"shape is {values.shape}, expected ({y.num_faces}, 3, 2)")
    values = np.ascontiguousarray(values)
    carried = np.empty((x.num_faces, 3, 2))
    mapped = _Mapped(result, x, y)
    _library.call(
        "carry_texture", ctypes.byref(mapped.pair), address(values), address(carried)
    )
    return carried


def _has_display() -> bool:
    """Without one a browser of texts would take the terminal, and draw nothing."""
    names = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    return not sys.platform.startswith("linux") or any(map(os.environ.get, names))


def in_notebook() -> bool:
    """Whether a kernel of Jupyter runs this, which shows HTML."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return shell is not None and "IPKernelApp" in getattr(shell, "config", {})


def frame(page: str) -> str:
    """The page within another one."""
    if len(page) > _MOST_INLINE_BYTES:
        return (
            f"<p>The page of this map has {len(page) / 1e6:.0f} MB, too many for a "
            "notebook: <code>result.view('map.html')</code> writes it.</p>"
        )
    import html

    return (
        f'<iframe srcdoc="{html.escape(page)}" width="100%" height="520" '
        'style="border: 0" allow="fullscreen"></iframe>'
    )


def show(page: str, path: str | os.PathLike[str] | None) -> pathlib.Path | None:
    """MatchResult.view."""
    if path is not None:
        target = pathlib.Path(path)
        target.write_text(page, encoding="utf-8")
        return target
    if in_notebook():
        from IPython.display import HTML, display

        display(HTML(frame(page)))
        return None
    import tempfile
    import webbrowser

    target = pathlib.Path(tempfile.mkdtemp(prefix="isomatch-")) / "map.html"
    target.write_text(page, encoding="utf-8")
    if not (_has_display() and webbrowser.open(target.as_uri())):
        print(f"isomatch: no browser found; the page is {target}", file=sys.stderr)
    return target
