"""Client and Job: jobs that are started, watched, cancelled and fetched apart."""

import asyncio
import datetime
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

import forwarding_server
import resetting_server
import support

import isomatch
from isomatch import _draco, _messages, _transport
from isomatch._status_messages import job_status
from isomatch.mesh import as_mesh

INTERRUPTED = """
import sys, isomatch
def show(status):
    print(status.name, flush=True)
isomatch.match(*sys.argv[2:4], server=sys.argv[1], profile="paper", on_progress=show)
"""

VANISHING = """
import os, signal, isomatch
print(isomatch.Client().server, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


class Cutting:
    """A streaming RPC, sync or aio, whose first stream ends as one that the
    server ends: cancelled, after one message."""

    def __init__(self, rpc):
        self._rpc = rpc
        self.started_after = []

    def __call__(self, request, **options):
        self.started_after.append(request.after_sequence)
        call = self._rpc(request, **options)
        return call if len(self.started_after) > 1 else CutCall(call)


class CutCall:
    def __init__(self, call):
        self._call = call
        self.cancel = call.cancel
        self.done = call.done

    def __iter__(self):
        for message in self._call:
            yield message
            self._call.cancel()

    async def __aiter__(self):
        async for message in self._call:
            yield message
            self._call.cancel()


class JobsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = cls.enterClassContext(support.Server("--ephemeral"))
        cls.client = cls.enterClassContext(isomatch.Client(cls.server.address))

    def test_a_job_is_watched_to_its_end(self):
        job = self.client.submit(*support.pair())
        sequences = [status.sequence for status in job.watch()]
        self.assertEqual(sequences, sorted(set(sequences)))
        self.assertIs(job.status.state, isomatch.JobState.SUCCEEDED)
        self.assertLessEqual(job.status.start_time, job.status.end_time)

    def test_a_heartbeat_is_no_change(self):
        class Beating:
            """A stream that says everything twice."""

            def __init__(self, stream):
                self.stream = stream
                self.cancel = stream.cancel

            def __iter__(self):
                for response in self.stream:
                    yield response
                    yield response

        rpcs = self.client._transport.rpcs
        watch = rpcs.WatchJob
        job = self.client.submit(*support.pair())
        with mock.patch.object(rpcs, "WatchJob", lambda *a, **b: Beating(watch(*a, **b))):
            sequences = [status.sequence for status in job.watch()]
        self.assertEqual(sequences, sorted(set(sequences)))

    def test_a_result_can_be_fetched_by_its_name(self):
        name = self.client.submit(*support.pair()).name
        with isomatch.Client(self.server.address) as other:
            result = other.job(name).result()
        self.assertEqual(
            support.as_map_file(result.y_from_x), support.map_of_command_line(*support.pair())
        )

    def test_several_jobs_are_followed_in_one_event_loop(self):
        async def follow(job):
            return [status async for status in job.progress()]

        async def follow_all(jobs):
            return await asyncio.gather(*map(follow, jobs))

        jobs = [self.client.submit(*support.pair(), random_seed=seed) for seed in (1, 2)]
        for seen in asyncio.run(follow_all(jobs)):
            self.assertIs(seen[-1].state, isomatch.JobState.SUCCEEDED)
            self.assertGreater(len(seen), 1)

    def test_leaving_an_async_watch_does_not_end_the_job(self):
        async def first(job):
            async for status in job.progress():
                return status

        job = self.client.submit(*support.pair())
        self.assertFalse(asyncio.run(first(job)).is_terminal)
        job.result()

    def test_a_lost_watch_goes_on_after_what_was_seen(self):
        job = self.client.submit(*support.pair())
        rpcs = job._transport.rpcs
        cutting = Cutting(rpcs.WatchJob)
        with mock.patch.object(rpcs, "WatchJob", cutting):
            sequences = [status.sequence for status in job.watch()]
        self.assertEqual(cutting.started_after, [0, sequences[0]])
        self.assertEqual(sequences, sorted(set(sequences)))

    def test_a_lost_async_watch_goes_on_after_what_was_seen(self):
        async def follow(job):
            return [status.sequence async for status in job.progress()]

        job = self.client.submit(*support.pair())
        made = []

        class CuttingRpcs(_transport.Rpcs):
            def __init__(self, channel):
                super().__init__(channel)
                self.WatchJob = Cutting(self.WatchJob)
                made.append(self.WatchJob)

        with mock.patch.object(_transport, "Rpcs", CuttingRpcs):
            sequences = asyncio.run(follow(job))
        self.assertEqual(made[0].started_after, [0, sequences[0]])
        self.assertEqual(sequences, sorted(set(sequences)))

    def test_a_cancelled_job_has_no_result(self):
        job = self.client.submit(*support.slow_pair(), **support.SLOW)
        job.cancel()
        with self.assertRaises(isomatch.JobCancelled):
            job.result()
        self.assertIs(job.cancel().state, isomatch.JobState.CANCELLED)

    def test_jobs_are_found_by_label_and_state(self):
        labels = {"test": "found_by_label"}
        names = [self.client.submit(*support.pair(), labels=labels).name for _ in range(3)]
        for name in names:
            self.client.job(name).result()
        found = self.client.jobs(labels=labels, page_size=2)
        self.assertEqual([status.name for status in found], names[::-1])
        failed = self.client.jobs(labels=labels, states=[isomatch.JobState.FAILED])
        self.assertEqual(list(failed), [])

    def test_a_deleted_job_is_unknown(self):
        job = self.client.submit(*support.pair())
        job.result()
        job.delete()
        with self.assertRaises(isomatch.NotFound) as caught:
            self.client.job(job.name)
        self.assertEqual(caught.exception.reason, "JOB_NOT_FOUND")

    def test_an_uploaded_mesh_is_matched_by_its_name(self):
        x, y = support.pair()
        template = self.client.upload(x)
        result = self.client.submit(template, y).result()
        self.assertEqual(support.as_map_file(result.y_from_x), support.map_of_command_line(x, y))

    def test_meshes_beyond_one_request_are_uploaded(self):
        x, y = support.pair()
        limits = self.client.info().limits
        small = mock.Mock(max_request_bytes=1000, max_chunk_bytes=limits.max_chunk_bytes)
        with (
            mock.patch.object(self.client, "_known_limits", small),
            mock.patch.object(self.client, "_upload", wraps=self.client._upload) as upload,
        ):
            job = self.client.submit(x, y)
        self.assertEqual(upload.call_count, 2)
        self.assertEqual(
            support.as_map_file(job.result().y_from_x), support.map_of_command_line(x, y)
        )

    def test_a_mesh_that_went_after_its_upload_is_brought_again(self):
        x, y = support.sample("C", 800), support.pair()[1]
        with forwarding_server.ForwardingServer(self.server.address) as between:
            between.take_only_small_requests()
            requests = between.lose_meshes_before_the_first_job(self.client)
            with isomatch.Client(between.address) as client:
                job = client.submit(x, y)
                self.assertEqual(len(requests), 2)
                self.assertEqual(*requests)
                # What only the caller holds stays an error.
                named = client.upload(x)
                list(job.watch())
                job.delete()
                requests.clear()
                between.before["CreateJob"] = requests.append
                with self.assertRaises(isomatch.FailedPrecondition) as caught:
                    client.submit(named, named)
                self.assertEqual(caught.exception.reason, "MESH_MISSING")
                self.assertEqual(len(requests), 1)

    def test_the_limits_of_a_run_are_told(self):
        hour = datetime.timedelta(hours=1)
        self.assertEqual(self.client.info().max_run_time, hour)
        for asked, held in ((None, hour), (90, datetime.timedelta(seconds=90)), (7200, hour)):
            run = self.client.submit(*support.pair(), run_timeout=asked).status.run
            self.assertEqual((run.timeout, run.faults, run.unresponsive), (held, 0, False))

    def test_an_upload_that_broke_off_goes_on(self):
        vertices, faces = isomatch.read_mesh(support.sample("C", 1000))
        mesh = as_mesh((2 * vertices, faces), "mesh")
        data = _draco.encode(mesh.positions, mesh.faces).data
        digest = _messages.Digest(
            sha256=hashlib.sha256(data).hexdigest(), size_bytes=len(data)
        )
        self.assertEqual(self.client._find_received(digest), 0)
        rpcs = self.client._transport.rpcs

        def broken():
            yield _messages.UploadMeshRequest(header=digest)
            yield _messages.UploadMeshRequest(chunk=data[:10_000])
            time.sleep(0.5)
            raise OSError("the cable")

        # On a busy machine the end may overtake what was sent, which is then lost.
        for _ in range(10):
            with self.assertRaises(Exception):
                rpcs.UploadMesh(broken())
            if self.client._find_received(digest) == 10_000:
                break
        offsets = []

        def counting(messages, **options):
            messages = list(messages)
            offsets.append(messages[0].offset)
            return upload(iter(messages), **options)

        upload = rpcs.UploadMesh
        with mock.patch.object(rpcs, "UploadMesh", counting):
            self.client.upload((2 * vertices, faces))
        self.assertEqual(offsets, [10_000])
        self.assertIsNone(self.client._find_received(digest))

    def test_an_interrupted_match_cancels_its_job(self):
        x, y = support.slow_pair()
        process = subprocess.Popen(
            [sys.executable, "-c", INTERRUPTED, self.server.address, x, y],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        name = process.stdout.readline().strip()
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=30)
        self.assertIn("KeyboardInterrupt", stderr)
        # Soon, not ten seconds later when the server sees that nobody watches.
        deadline = time.monotonic() + 5
        while not (status := self.client.job(name).status).is_terminal:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.01)
        self.assertIs(status.state, isomatch.JobState.CANCELLED)


class JobStatusTest(unittest.TestCase):
    def test_a_queued_job_tells_what_it_waits_for(self):
        for number, expected in ((0, "turn"), (1, "storage"), (2, "inputs"), (99, "turn")):
            job = _messages.Job(state="STATE_QUEUED", waiting_for=number)
            self.assertEqual(job_status(job).waiting_for, expected)
        job = _messages.Job(state="STATE_RUNNING")
        self.assertEqual(job_status(job).waiting_for, "")


class ResetStreamsTest(unittest.TestCase):
    """What a proxy does that loses its server."""

    INTERNAL_ERROR = 2
    REFUSED_STREAM = 7
    CANCEL = 8

    def expect_tried_again(self, error_code, call):
        """Of a call: it is Unavailable in the end, and not after the first time."""
        with resetting_server.ResettingServer(error_code) as server:
            with isomatch.Client(server.address, patience=0.5) as client:
                with self.assertRaises(isomatch.Unavailable):
                    call(client)
            self.assertGreater(server.streams, 1)

    def job_of(self, client):
        snapshot = mock.Mock(spec=isomatch.JobStatus, is_terminal=False)
        snapshot.name = "jobs/1"
        return isomatch.Job(client._transport, snapshot)

    def test_every_call_is_tried_again(self):
        async def follow(client):
            async for _ in self.job_of(client).progress():
                pass

        calls = {
            "info": lambda client: client.info(),
            "jobs": lambda client: list(client.jobs()),
            "watch": lambda client: list(self.job_of(client).watch()),
            "progress": lambda client: asyncio.run(follow(client)),
            "download": lambda client: self.job_of(client)._download("map"),
        }
        for name, call in calls.items():
            with self.subTest(name=name):
                self.expect_tried_again(self.INTERNAL_ERROR, call)

    def test_however_it_is_reset(self):
        for code in (self.REFUSED_STREAM, self.CANCEL):
            with self.subTest(code=code):
                self.expect_tried_again(code, lambda client: client.info())


class LostServerTest(unittest.TestCase):
    def test_a_watch_goes_on_after_the_server_was_killed(self):
        with (
            tempfile.TemporaryDirectory() as data,
            support.Server(f"--data-dir={data}") as server,
            isomatch.Client(server.address) as client,
        ):
            job = client.submit(*support.slow_pair(), solved_vertices=1500, **support.SLOW)
            killed = False
            sequences = []
            for status in job.watch():
                sequences.append(status.sequence)
                if not killed and status.stage_fraction > 0:
                    killed = True
                    server.kill()
                    server.start()
            self.assertIs(job.status.state, isomatch.JobState.SUCCEEDED)
            self.assertEqual(job.status.attempt, 2)
            self.assertEqual(sequences, sorted(set(sequences)))
            self.assertEqual(len(job.result().y_from_x), 3000)

    def test_an_async_watch_goes_on_after_the_server_was_killed(self):
        async def follow(job, server):
            killed = False
            async for status in job.progress():
                if not killed:
                    killed = True
                    server.kill()
                    server.start()

        with (
            tempfile.TemporaryDirectory() as data,
            support.Server(f"--data-dir={data}") as server,
            isomatch.Client(server.address) as client,
        ):
            job = client.submit(*support.pair())
            asyncio.run(follow(job, server))
            self.assertIs(job.status.state, isomatch.JobState.SUCCEEDED)

    def test_a_server_that_stays_away_is_given_up(self):
        with support.Server("--ephemeral") as server:
            client = isomatch.Client(server.address, patience=0.5)
            job = client.submit(*support.slow_pair(), **support.SLOW)
        with self.assertRaises(isomatch.Unavailable):
            list(job.watch())
        with self.assertRaisesRegex(isomatch.Unavailable, "expected a running isomatch-server"):
            client.info()

    def test_the_embedded_server_ends_with_its_process(self):
        process = subprocess.run(
            [sys.executable, "-c", VANISHING], stdout=subprocess.PIPE, text=True, timeout=30
        )
        self.assertEqual(process.returncode, -signal.SIGKILL)
        client = isomatch.Client(process.stdout.strip(), patience=0.2)
        deadline = time.monotonic() + 10
        while time.monotonic() < deadline:
            try:
                client.info()
            except isomatch.Unavailable:
                return
            time.sleep(0.01)
        self.fail("it still answers")

    def test_without_a_binary_the_error_tells_where_it_is_looked_for(self):
        environment = {**os.environ, "ISOMATCH_SERVER_BINARY": "/nowhere"}
        process = subprocess.run(
            [sys.executable, "-c", "import isomatch; isomatch.Client()"],
            env=environment,
            stderr=subprocess.PIPE,
            text=True,
            timeout=30,
        )
        self.assertIn("ServerNotStarted: ISOMATCH_SERVER_BINARY=/nowhere", process.stderr)


if __name__ == "__main__":
    unittest.main()
