"""The embedded server: one isomatch-server for this process."""

from __future__ import annotations

import atexit
import collections
import os
import re
import shutil
import subprocess
import threading

from isomatch.errors import ServerNotStarted

_BINARY = "isomatch-server"
_FLAGS = [
    "--ephemeral",
    "--listen=127.0.0.1:0",
    "--metrics-listen=off",
    "--drain-timeout=0s",
]
# Stops the server when this process closes its end of the pipe, however it
# ends. `$@` is the server's command line.
_GUARD = '"$@" & server=$!; read -r _; kill -TERM $server 2>/dev/null; wait $server'
_START_SECONDS = 30.0
_STOP_SECONDS = 5.0


def _find_binary() -> str:
    named = os.environ.get("ISOMATCH_SERVER_BINARY")
    found = shutil.which(named or _BINARY)
    if found is not None:
        return found
    where = f"ISOMATCH_SERVER_BINARY={named}" if named else f"{_BINARY} in PATH"
    raise ServerNotStarted(
        f"{where}: no such program; expected the path of {_BINARY} in "
        "ISOMATCH_SERVER_BINARY, or server=HOST:PORT of one that runs"
    )


def _environment() -> dict[str, str]:
    """Without the flags of another server: this one is our own."""
    return {k: v for k, v in os.environ.items() if not k.startswith("ISOMATCH_")}


class EmbeddedServer:
    """A server on a free loopback port, which ends with this process."""

    def __init__(self) -> None:
        binary = _find_binary()
        self._last_lines: collections.deque[str] = collections.deque(maxlen=5)
        self._listens = threading.Event()
        self.address = ""
        # A session of its own: Ctrl-C is for us, who then cancel the job.
        self._process = subprocess.Popen(
            ["/bin/sh", "-c", _GUARD, "sh", binary, *_FLAGS],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=_environment(),
            start_new_session=True,
        )
        threading.Thread(target=self._read_log, daemon=True).start()
        self._listens.wait(_START_SECONDS)
        if not self.address:
            self.stop()
            said = " ".join(self._last_lines) or "nothing"
            raise ServerNotStarted(f"{binary}: did not start; it said: {said}")

    def _read_log(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as log:
            for line in log:
                self._last_lines.append(line.strip())
                found = re.search(r"listens on (\S+)", line)
                if found:
                    self.address = found.group(1)
                    self._listens.set()
        self.address = ""
        self._listens.set()

    @property
    def runs(self) -> bool:
        return self.address != ""

    def stop(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(_STOP_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


_lock = threading.Lock()
_server: EmbeddedServer | None = None


def embedded_address() -> str:
    """HOST:PORT of this process's server, started at the first call.

    ServerNotStarted when there is no binary or it does not start.
    """
    global _server
    with _lock:
        if _server is None or not _server.runs:
            _server = EmbeddedServer()
            atexit.register(_server.stop)
        return _server.address
