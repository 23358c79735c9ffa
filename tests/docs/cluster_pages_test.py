"""What server/README.md tells of several machines, followed step by step: real
clusters of scripts/cluster, and the commands as they stand there."""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import programs
import readme
from cluster import POSTGRES, Client, Cluster, wait_until
from readme import ROOT
from readme_commands_test import free_port, run_script, starts_server

MANUAL = "server/README.md"
SEEDS = (1, 2, 3)

# What the manual calls the database.
ITS_STORE = "postgresql://isomatch@db.example.org/isomatch"


def blocks(section, language):
    text = (ROOT / MANUAL).read_text()
    return [readme.lines(block.text) for block in readme.blocks(MANUAL, text)
            if (block.section, block.language) == (section, language)]  # fmt: skip


def replaced(line, old, new):
    assert old in line, f"expected {old} in: {line}"
    return line.replace(old, new)


def as_services(lines, port):
    """Returns the commands of a manual with its servers in the background, each as
    soon as the gateway listens."""
    steps = ["set -euo pipefail", "trap 'kill $(jobs -p) 2>/dev/null || true; wait' EXIT"]
    for line in lines:
        is_server = line.startswith("isomatch-server --role")
        steps.append(line + " &" if is_server else line)
        if starts_server(line):
            steps.append(f"until (: < /dev/tcp/127.0.0.1/{port}) 2>/dev/null")
            steps.append("do kill -0 $!; sleep 0.05; done")
    return "\n".join(steps)


class ClusterPagesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory(prefix="isomatch-cluster-")
        cls.addClassCleanup(scratch.cleanup)
        cls.folder = pathlib.Path(scratch.name)
        for name, pose in (("X.off", "A"), ("Y.off", "B")):
            command = [programs.CLIENT, "sample", "--pose", pose, "--vertices", "1500", "-o", name]
            subprocess.run(command, cwd=cls.folder, check=True, timeout=60)
        # By seed, what the command line finds without a server.
        cls.expected = {}
        for seed in SEEDS:
            command = [programs.CLIENT, "match", "X.off", "Y.off", "--threads", "1"]
            command += ["--random-seed", str(seed), "-o", "expected.txt", "--no-progress"]
            subprocess.run(command, cwd=cls.folder, check=True, timeout=60)
            cls.expected[seed] = (cls.folder / "expected.txt").read_bytes()
        cls.cluster = cls.enterClassContext(Cluster(cls.folder / "cluster"))

    def client(self, cluster):
        return Client(cluster.address, self.folder)

    def submit(self, client, count):
        """Returns the seeds of new jobs by the jobs' names."""
        seeds = [SEEDS[i % len(SEEDS)] for i in range(count)]
        return {client.submit("X.off", "Y.off", "--random-seed", str(seed)): seed
                for seed in seeds}  # fmt: skip

    def new_database(self, name):
        """Returns the URL of an empty database of the cluster's PostgreSQL."""
        store = self.cluster.own_store
        command = [POSTGRES / "psql", "-q", store, "-c", f"CREATE DATABASE {name}"]
        subprocess.run(command, check=True, timeout=60)
        return store.replace("/isomatch?", f"/{name}?")

    def run_lines(self, lines, store=""):
        """Runs commands of the manual, whose $STORE is `store`."""
        script = [f"export STORE='{store}' PATH=\"$PATH:{POSTGRES}\"", "set -eu", *lines]
        status, said = run_script("\n".join(script), self.folder)
        self.assertEqual(status, 0, f"{lines}\n{said}")

    def assert_all_succeed(self, client, seeds):
        """Each of the jobs has ended well, and its map is the command line's. Returns
        the jobs."""
        jobs = client.wait_for_all()
        self.assertEqual(sorted(set(seeds) - set(jobs)), [], "lost")
        for name, seed in seeds.items():
            self.assertEqual(jobs[name]["state"], "STATE_SUCCEEDED", jobs[name])
            client.run("get", name, "-o", "map.txt")
            found = (self.folder / "map.txt").read_bytes()
            self.assertEqual(found, self.expected[seed], f"{name}, seed {seed}")
        return {name: jobs[name] for name in seeds}

    def assert_started_once(self, jobs):
        starts = {name: (job["attempt"], job["run"]["faults"]) for name, job in jobs.items()}
        self.assertEqual(set(starts.values()), {(1, 0)}, starts)

    def begin(self, client, *words):
        """Returns a command that has not ended, or ends with the test."""
        command = client.start(*words)
        self.addCleanup(command.communicate)
        self.addCleanup(command.kill)
        return command

    def assert_sees_the_end(self, watch):
        said = watch.communicate(timeout=60)
        self.assertEqual(watch.returncode, 0, said)

    def wait_until_both_work(self, client):
        wait_until(lambda: len(client.names("RUNNING")) == 2, "both workers have a job")

    def test_migrate_gateway_and_worker(self):
        [lines] = blocks("Several machines", "sh")
        [security] = blocks("Security", "sh")
        *keys, _, match = security
        port, store = free_port(), self.new_database("manual")
        migrate, gateway, worker = (replaced(line, ITS_STORE, f"'{store}'") for line in lines)
        steps = [
            *keys, migrate, replaced(gateway, ":7443", f":{port}"), worker,
            replaced(match, "meshes.example.org:7443", f"localhost:{port}"),
        ]  # fmt: skip
        self.run_lines([as_services(steps, port)])
        self.assertEqual((self.folder / "map.txt").read_bytes(), self.expected[1])

    def test_backup_and_restore(self):
        [backup], restore = blocks("Running it", "sh")
        store, restored = self.new_database("original"), self.new_database("restored")
        with Cluster(self.folder / "original", store) as cluster:
            client = self.client(cluster)
            before = self.submit(client, 2)
            self.assert_all_succeed(client, before)
            then = self.submit(client, 6)
            self.wait_until_both_work(client)
            self.run_lines([backup], store)
            [later] = self.submit(client, 1)
        self.run_lines(restore, restored)
        with Cluster(self.folder / "restored", restored) as cluster:
            client = self.client(cluster)
            jobs = self.assert_all_succeed(client, {**before, **then})
            self.assertNotIn(later, client.jobs())
        # Those that ran when it was made, at most one a worker, started again.
        starts = {name: job["attempt"] for name, job in jobs.items()}
        self.assertLessEqual(sum(starts.values()), len(starts) + 2, starts)

    def test_upgrade_while_jobs_run(self):
        client = self.client(self.cluster)
        seeds, failures, stop = {}, [], threading.Event()

        def submit_all_the_time():
            try:
                while not stop.is_set():
                    # Always more than the workers take, however fast they are.
                    if len(client.names("QUEUED")) < 6:
                        seeds.update(self.submit(client, 4))
                    stop.wait(0.2)
            except AssertionError as failure:
                failures.append(failure)

        first = self.submit(client, 4)
        watch = self.begin(client, "watch", list(first)[-1])
        stream = threading.Thread(target=submit_all_the_time)
        stream.start()
        try:
            [[migrate, *_]] = blocks("Several machines", "sh")
            self.run_lines([replaced(migrate, ITS_STORE, '"$STORE"')], self.cluster.own_store)
            for name in ("gateway-1", "gateway-2"):
                self.cluster.exchange(name)
            for name in ("worker-1", "worker-2"):
                self.wait_until_both_work(client)
                self.cluster.exchange(name)
        finally:
            stop.set()
            stream.join()
        self.assertEqual(failures, [])
        self.assert_started_once(self.assert_all_succeed(client, {**first, **seeds}))
        self.assert_sees_the_end(watch)
        # What a worker gives back waits again.
        self.assertRegex(self.cluster.logs("worker"), r"job \w+ QUEUED")

    def test_the_database_is_away(self):
        client = self.client(self.cluster)
        seeds = self.submit(client, 5)
        watch = self.begin(client, "watch", list(seeds)[-1])
        self.wait_until_both_work(client)
        ended = self.cluster.ended()
        # Nothing starts again while the script is stopped.
        self.cluster.script.send_signal(signal.SIGSTOP)
        os.kill(self.cluster.starts("database")[-1], signal.SIGKILL)
        begin = time.monotonic()
        impatient = self.begin(client, "list")
        self.assertIn("(STORAGE_FAILED)", impatient.communicate(timeout=60)[1])
        self.assertEqual(impatient.returncode, 1)
        self.assertGreater(time.monotonic() - begin, 8)
        self.cluster.script.send_signal(signal.SIGCONT)
        wait_until(client.is_answered, "the database is back")
        self.assert_started_once(self.assert_all_succeed(client, seeds))
        self.assert_sees_the_end(watch)
        said = self.cluster.logs("gateway")
        self.assertRegex(said, "ListJobs UNAVAILABLE")
        self.assertNotRegex(said, f"WatchJob UNAVAILABLE.*{list(seeds)[-1].rpartition('/')[2]}")
        self.assertEqual(self.cluster.ended()[len(ended):], ["database"])


if __name__ == "__main__":
    if not (programs.CLIENT.is_file() and programs.SERVER.is_file()):
        sys.exit("set ISOMATCH_BINARY and ISOMATCH_SERVER_BINARY, as ctest does")
    unittest.main()
