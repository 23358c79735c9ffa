"""Clusters of scripts/cluster, and a client of theirs."""

import json
import os
import pathlib
import re
import signal
import subprocess
import time

import programs
from readme import ROOT
from readme_commands_test import free_port

POSTGRES = pathlib.Path("/usr/lib/postgresql/15/bin")


def wait_until(condition, what, seconds=60):
    """Returns the first value of `condition` that is true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"not within {seconds} s: {what}")


class Cluster:
    """What scripts/cluster runs: two gateways and two workers, with a database of its
    own or that of `store`. Ends with its context."""

    def __init__(self, folder, store=""):
        self.folder = folder
        self.folder.mkdir(exist_ok=True)
        self.own_store = f"postgresql://isomatch@/isomatch?host={folder}"
        port = free_port((0, 1, 1000, 1001, 2000, 2001))
        self.address = f"127.0.0.1:{port},127.0.0.1:{port + 1}"
        # A worker that has to end gives back at once what it runs.
        self.command = [
            ROOT / "scripts/cluster", "--gateways=2", "--workers=2", f"--port={port}",
            f"--folder={folder}", f"--bin={programs.SERVER.parent}", "--threads-per-job=1",
            "--lease=5s", "--drain-timeout=0",
        ]  # fmt: skip
        if store:
            self.command.append(f"--store={store}")

    def __enter__(self):
        environment = programs.environment(self.folder)
        environment.pop("ISOMATCH_METRICS_LISTEN")  # the script says where
        with open(self.folder / "cluster.log", "wb") as log:
            self.script = subprocess.Popen(
                self.command, stdout=log, stderr=log, env=environment, start_new_session=True
            )
        try:
            wait_until(lambda: "ready: " in self.said() or self.script.poll() is not None, "ready")
            assert self.script.poll() is None, self.said()
        except AssertionError:
            self.end()
            raise
        return self

    def __exit__(self, *_):
        self.end()

    def end(self):
        """Ends all its processes; again is allowed."""
        self.script.send_signal(signal.SIGCONT)
        self.script.terminate()
        self.script.wait(60)

    def said(self):
        return (self.folder / "cluster.log").read_text()

    def starts(self, name):
        """Returns the numbers of a process, such as gateway-1, one for each start."""
        numbers = re.findall(rf"{name} started, process (\d+)", self.said())
        return [int(number) for number in numbers]

    def ended(self):
        """Returns the names of processes that have ended."""
        return re.findall(r"^\S+ (\S+) ended", self.said(), re.MULTILINE)

    def exchange(self, name):
        """Ends a process by SIGTERM, and waits for the one that takes its place."""
        before = self.starts(name)
        os.kill(before[-1], signal.SIGTERM)
        wait_until(lambda: len(self.starts(name)) > len(before), f"{name} starts again")
        role = "listens" if name.startswith("gateway") else "runs jobs"
        begins = rf"isomatch-server \S+ {role}"
        wait_until(lambda: len(re.findall(begins, self.log(name))) > len(before), f"{name} works")

    def log(self, name):
        return (self.folder / f"{name}.log").read_text()

    def logs(self, role):
        return "".join(self.log(f"{role}-{number}") for number in (1, 2))


class Client:
    """The command line, as a client of a server."""

    def __init__(self, address, folder):
        self.address, self.folder = address, folder

    def start(self, *words):
        """Begins a command; run() is one that is waited for."""
        return subprocess.Popen(
            [programs.CLIENT, *words, "--server", self.address], cwd=self.folder, text=True,
            env=programs.environment(self.folder), stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def run(self, *words):
        """Returns what a command prints."""
        command = self.start(*words)
        printed, said = command.communicate(timeout=100)
        assert command.returncode == 0, f"isomatch {' '.join(words)}: {said}"
        return printed

    def is_answered(self):
        """Whether a call succeeds, after as many attempts as the client makes."""
        command = self.start("list")
        command.communicate(timeout=100)
        return command.returncode == 0

    def submit(self, *words):
        return self.run("submit", *words).strip()

    def jobs(self):
        """Returns the server's jobs by their names, as ListJobs tells them."""
        jobs = map(json.loads, self.run("list", "--json", "--limit", "1000").splitlines())
        return {job["name"]: job for job in jobs}

    def names(self, state):
        """Returns the names of the jobs in a state, such as RUNNING."""
        return [name for name, job in self.jobs().items() if job["state"] == f"STATE_{state}"]

    def wait_for_all(self):
        """Returns jobs() when none waits or runs."""
        live = ("--state", "queued", "--state", "running", "--names")
        wait_until(lambda: not self.run("list", *live), "all jobs have ended")
        return self.jobs()
