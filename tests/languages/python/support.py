"""What the tests of the clients share: the sample meshes and real servers.

The binaries are those that ISOMATCH_BINARY and ISOMATCH_SERVER_BINARY name.
"""

import atexit
import ctypes
import functools
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np

import isomatch

CLIENT_BINARY = os.environ["ISOMATCH_BINARY"]
SERVER_BINARY = os.environ["ISOMATCH_SERVER_BINARY"]

#: A profile that takes seconds on the slow pair, so that there is something to
#: interrupt.
SLOW = {"profile": "paper"}

_PR_SET_PDEATHSIG = 1


def _end_with_the_test() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


class Server:
    """A real server; `with Server("--ephemeral") as server: server.address`."""

    def __init__(self, *flags: str, listen: str = "127.0.0.1:0") -> None:
        self._flags = [f"--listen={listen}", "--metrics-listen=off", *flags]
        self._process: subprocess.Popen[str]
        self.address = ""
        self.start()

    def start(self) -> None:
        """Again at the address that it had before, if there was one."""
        self._process = subprocess.Popen(
            [SERVER_BINARY, *self._flags],
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=_end_with_the_test,
        )
        log = []
        for line in self._process.stderr:
            log.append(line)
            found = re.search(r"listens on (\S+)", line)
            if found:
                self.address = found.group(1)
                self._flags[0] = f"--listen={self.address}"
                # Its log must not fill the pipe.
                threading.Thread(target=self._process.communicate, daemon=True).start()
                return
        raise RuntimeError(f"the server did not start: {''.join(log)}")

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.kill()


def run_isomatch(*arguments: str | os.PathLike[str]) -> None:
    subprocess.run([CLIENT_BINARY, *arguments], check=True, timeout=120)


#: Of requires-python.
OLDEST_PYTHON = (3, 9)


def other_pythons() -> dict[str, pathlib.Path]:
    """The Pythons of this machine that the package is for, but the one that runs this:
    those of pyenv, whose shims in PATH need not work, and others in PATH."""
    folders = [*pathlib.Path.home().glob(".pyenv/versions/*/bin")]
    folders += map(pathlib.Path, os.environ["PATH"].split(os.pathsep))
    found = {}
    for folder in folders:
        if folder.name == "shims":
            continue
        for file in folder.glob("python3.*"):
            version = re.fullmatch(r"python3\.(\d+)", file.name)
            if version and (3, int(version.group(1))) >= OLDEST_PYTHON and os.access(file, os.X_OK):
                found.setdefault(file.name, file)
    found.pop("python{}.{}".format(*sys.version_info), None)
    return found


@functools.cache
def folder() -> pathlib.Path:
    """Of this process, removed at its end."""
    path = tempfile.mkdtemp(prefix="isomatch-languages-")
    atexit.register(shutil.rmtree, path)
    return pathlib.Path(path)


@functools.cache
def sample(pose: str, vertices: int) -> pathlib.Path:
    path = folder() / f"{pose}{vertices}.off"
    run_isomatch("sample", "--pose", pose, "--vertices", str(vertices), "-o", path)
    return path


def pair() -> tuple[pathlib.Path, pathlib.Path]:
    return sample("A", 1000), sample("B", 900)


def slow_pair() -> tuple[pathlib.Path, pathlib.Path]:
    return sample("A", 3000), sample("B", 3000)


@functools.cache
def truth() -> np.ndarray:
    """For each vertex of pair()'s X its vertex of Y."""
    path = folder() / "truth.txt"
    run_isomatch(
        "sample", "--pose", "B", "--vertices", "900", "-o", folder() / "again.off",
        "--truth-from", "A:1000", "--truth", path,
    )  # fmt: skip
    return np.loadtxt(path, dtype=int)


def sheet(side: int) -> tuple[np.ndarray, np.ndarray]:
    """A wavy sheet of side x side vertices, numbered at random."""
    u, v = np.meshgrid(np.arange(side), np.arange(side))
    height = np.sin(0.7 * u) * np.cos(0.4 * v)
    vertices = np.stack([u, v, height], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (u + side * v)[:-1, :-1].ravel()
    lower = np.stack([corner, corner + 1, corner + side], axis=1)
    upper = np.stack([corner + 1, corner + side + 1, corner + side], axis=1)
    new_from_old = np.random.default_rng(1).permutation(side * side)
    renumbered = np.empty_like(vertices)
    renumbered[new_from_old] = vertices
    return renumbered, new_from_old[np.vstack([lower, upper])]


def write_ply(path: pathlib.Path, vertices: np.ndarray, faces: np.ndarray) -> pathlib.Path:
    """Binary; returns the path."""
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())
    return path


def write_stl(
    path: pathlib.Path, vertices: np.ndarray, faces: np.ndarray, header: bytes = b"solid binary"
) -> pathlib.Path:
    """Binary; returns the path. The header begins as that of a text, as many do."""
    facets = np.zeros(
        len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    )
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    facets["normal"] = np.cross(b - a, c - a)
    facets["corners"] = vertices[faces]
    path.write_bytes(header.ljust(80) + len(faces).to_bytes(4, "little") + facets.tobytes())
    return path


def write_ascii_stl(path: pathlib.Path, vertices: np.ndarray, faces: np.ndarray) -> pathlib.Path:
    """Returns the path."""
    lines = ["solid of # a sample"]
    for corners in vertices[faces].tolist():
        lines += ["facet normal 0 0 1", "  outer loop"]
        lines += [f"    vertex {x!r} {y!r} {z!r}" for x, y, z in corners]
        lines += ["  endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid of a sample", ""]))
    return path


@functools.cache
def map_of_command_line(x: pathlib.Path, y: pathlib.Path) -> bytes:
    """The file that `isomatch match` writes."""
    path = folder() / f"{x.stem}-{y.stem}.txt"
    run_isomatch("match", x, y, "-o", path, "--no-progress")
    return path.read_bytes()


def blocks(document: pathlib.Path, section: str, language: str) -> list[str]:
    """The fenced blocks of a language below a heading of a Markdown file."""
    text = document.read_text().partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def as_map_file(y_from_x: np.ndarray) -> bytes:
    return "".join(f"{y}\n" for y in y_from_x).encode()


def wait_for_state(
    job: isomatch.Job, state: isomatch.JobState, seconds: float
) -> isomatch.JobStatus:
    """Polls; returns the last snapshot."""
    end = time.monotonic() + seconds
    while job.refresh().state is not state and time.monotonic() < end:
        time.sleep(0.02)
    return job.status
