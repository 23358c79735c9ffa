"""How scripts/cluster refuses what it cannot run, and that no process outlives it."""

import contextlib
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import unittest

import programs
from cluster import Cluster, wait_until
from readme import ROOT
from readme_commands_test import free_port

# What stands for itself in no URL.
NAME = "a b&c#d%2"


def is_alive(number):
    with contextlib.suppress(ProcessLookupError):
        os.kill(number, 0)
        return True
    return False


class ClusterScriptTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory(prefix="isomatch-cluster-")
        cls.addClassCleanup(scratch.cleanup)
        cls.scratch = pathlib.Path(scratch.name)
        cls.folder = cls.scratch / NAME  # one after the other: a new database takes seconds

    def refused(self, *words):
        """Returns the error of scripts/cluster, which ends by itself with no process
        left."""
        environment = programs.environment(self.scratch)
        environment.pop("ISOMATCH_METRICS_LISTEN")  # the script says where
        command = [ROOT / "scripts/cluster", f"--bin={programs.SERVER.parent}",
                   "--gateways=1", "--workers=1", f"--port={free_port((0, 1000, 2000))}",
                   f"--folder={self.folder}", *words]  # fmt: skip
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        ) as script:
            try:
                said, error = script.communicate(timeout=60)
            except subprocess.TimeoutExpired:
                script.terminate()
                raise
        started = [int(number) for number in re.findall(r"started, process (\d+)", said)]
        self.assertEqual([number for number in started if is_alive(number)], [], said)
        self.assertNotEqual(script.returncode, 0)
        self.assertRegex(error, r"^scripts/cluster: .+\n$")
        return error

    def cluster(self, *flags):
        """Returns a cluster that ends with the test, and whatever it left."""
        cluster = Cluster(self.folder)
        cluster.command += flags
        self.addCleanup(self.kill, cluster)
        return self.enterContext(cluster)

    def processes(self, cluster):
        """Returns the numbers of its processes that live."""
        return [number for number in cluster.starts(r"\S+") if is_alive(number)]

    def kill(self, cluster):
        for number in self.processes(cluster):
            os.kill(number, signal.SIGKILL)

    def test_options(self):
        for words, expected in (
            (["--port=70000"], "--port: 70000 was given, expected .* from 1 to 62536"),
            (["--gateways=0"], "--gateways: 0 was given, expected .* from 1 to 1000"),
            (["--workers=-1"], "--workers: -1 was given, expected .* from 0 to 1000"),
            (["--listen=:1"], "--listen .* expected --port"),
            (["--folder=/proc/x"], "--folder /proc/x cannot be made: No such file"),
            ([f"--folder=/tmp/{'x' * 100}"], "has 105 bytes, expected at most 93"),
            (["--folder=/tmp/a,b"], "--folder /tmp/a,b has a comma"),
            (["--store=postgresql://nobody@127.0.0.1:1/x"], "migrate: database: .*Connection refused"),
        ):
            with self.subTest(words):
                self.assertRegex(self.refused(*words), expected)

    def test_wrong_flag(self):
        self.assertRegex(self.refused("--leas=3s"), "ended with status 2, .*: .*--leas=3s$")

    def test_what_is_in_use(self):
        cluster = self.cluster()
        port = cluster.address.rpartition(":")[2]
        self.assertIn(f"port {port} is in use", self.refused(f"--port={port}"))
        [database] = cluster.starts("database")
        in_use = f"{self.folder}/database is in use by process {database}:"
        self.assertIn(in_use, self.refused())

    def test_flags_that_become_wrong(self):
        config = self.scratch / "config.toml"
        config.write_text("max-kept-jobs = 10\n")
        cluster = self.cluster(f"--config={config}")
        config.write_text("max-kept-jobs = none\n")
        os.kill(cluster.starts("worker-1")[-1], signal.SIGTERM)
        self.assertEqual(cluster.script.wait(60), 1)
        self.assertRegex(cluster.said(), "scripts/cluster: worker-1 ended with status 2, ")
        self.assertEqual(self.processes(cluster), [])

    def test_second_signal(self):
        cluster = self.cluster()
        [worker] = cluster.starts("worker-1")
        os.kill(worker, signal.SIGSTOP)  # as one that is in no hurry
        cluster.script.send_signal(signal.SIGINT)
        wait_until(lambda: set(cluster.ended()) == {"gateway-1", "gateway-2", "worker-2"}, "drain")
        self.assertIn("a second signal ends them at once", cluster.said())
        cluster.script.send_signal(signal.SIGTERM)
        wait_until(lambda: "worker-1 ended by signal 9" in cluster.said(), "worker-1 is killed")
        cluster.script.send_signal(signal.SIGTERM)
        self.assertEqual(cluster.script.wait(60), 0)
        self.assertIn("database ended with status 0", cluster.said())
        self.assertEqual(self.processes(cluster), [])


if __name__ == "__main__":
    if not programs.SERVER.is_file():
        sys.exit("set ISOMATCH_BINARY and ISOMATCH_SERVER_BINARY, as ctest does")
    unittest.main()
