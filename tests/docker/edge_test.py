"""docker/edge: Debian's nginx with the very configuration of the image, before a server."""

import hashlib
import os
import pathlib
import random
import re
import shutil
import socket
import ssl
import statistics
import subprocess
import tempfile
import time
import unittest

import grpc

import deployment
import http2_flood
from deployment import ROOT
from isomatch.v1 import service_pb2 as pb
from isomatch.v1 import service_pb2_grpc

NGINX = shutil.which("nginx", path=os.environ["PATH"] + ":/usr/sbin")
MOST_BYTES = 300 << 20
PATIENCE_SECONDS = 30


def free_port():
    """Below the ports that the kernel gives to others, so that none of their connections
    takes it before nginx does."""
    for port in random.sample(range(20000, 30000), 100):
        with socket.socket() as probe:
            try:
                probe.bind(("0.0.0.0", port))
            except OSError:
                continue
            return port
    raise RuntimeError("no free port between 20000 and 30000")


def peak_bytes(pid):
    status = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) << 10


def children(pid):
    return pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split()


def wait_for(condition):
    end = time.monotonic() + PATIENCE_SECONDS
    while not condition():
        assert time.monotonic() < end, "it did not come to pass"
        time.sleep(0.05)


class EdgeTestCase(unittest.TestCase):
    """A server on a unix socket and the edge on a free port, in a folder of its own."""

    listen = "listen.conf"
    servers = "servers.conf"

    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        self.port = free_port()
        self.address = f"127.0.0.1:{self.port}"
        self.edge = None

    def start_server(self, *flags):
        """Returns its process once it listens."""
        # A file, not a pipe, which a flood's lines would fill.
        self.log = self.folder / "log"
        with self.log.open("w") as log:
            server = subprocess.Popen(
                [deployment.SERVER, "--listen", self.server_address(),
                 "--metrics-listen", "off", "--data-dir", self.folder / "data", *flags],
                env=deployment.environment({}), stderr=log,
            )  # fmt: skip
        self.addCleanup(server.wait)
        self.addCleanup(server.kill)
        wait_for(lambda: "listens on" in self.log.read_text())
        return server

    def configuration(self, name, places):
        """Writes a file of docker/edge with other places than in the image."""
        text = (ROOT / "docker/edge" / name).read_text()
        for place, other in places.items():
            self.assertIn(place, text)
            text = text.replace(place, str(other))
        path = self.folder / name
        path.write_text(text)
        return path

    def start_edge(self, changes=None):
        """With `changes` to its configuration, old text to new."""
        (self.folder / "tmp").mkdir()
        listen = self.configuration(self.listen, {"8443": self.port})
        servers = self.configuration(self.servers, self.upstream())
        path = self.configuration(
            "nginx.conf",
            {
                "/tmp/": f"{self.folder}/tmp/",
                "/etc/isomatch-edge/servers.conf": servers,
                "/run/secrets/isomatch/tls": self.folder / "tls",
                "/etc/isomatch-edge/listen.conf": listen,
                **(changes or {}),
            },
        )
        # The image has a user of its own; as root nginx would choose another.
        user = ["-g", "user root;"] if os.geteuid() == 0 else []
        self.edge_log = self.folder / "edge.log"
        with self.edge_log.open("w") as log:
            self.edge = subprocess.Popen(
                [NGINX, "-e", "stderr", "-p", self.folder, "-c", path, *user], stderr=log
            )
        self.addCleanup(self.edge.wait)
        self.addCleanup(self.edge.terminate)
        wait_for(self.edge_answers)

    def server_address(self):
        return f"unix:{self.folder}/socket"

    def upstream(self):
        """Places of `servers` as in the image, and where they are here."""
        return {"/run/isomatch/socket": self.folder / "socket"}

    def edge_answers(self):
        self.assertIsNone(self.edge.poll(), self.edge_log.read_text())
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", self.port)) == 0

    def channel(self):
        # Its own connection, not one that another test's channel has left.
        options = [("grpc.use_local_subchannel_pool", 1), ("grpc.max_reconnect_backoff_ms", 500)]
        return self.enterContext(grpc.insecure_channel(self.address, options=options))

    def stub(self):
        return service_pb2_grpc.CorrespondenceServiceStub(self.channel())

    def isomatch(self, *arguments):
        return subprocess.run(
            [deployment.CLIENT, *map(str, arguments)],
            env=deployment.environment({}), capture_output=True, text=True, timeout=100,
        )  # fmt: skip

    def pair(self, vertices):
        x, y = self.folder / "x.off", self.folder / "y.off"
        for pose, path in (("A", x), ("B", y)):
            made = self.isomatch("sample", "--pose", pose, "--vertices", vertices, "-o", path)
            self.assertEqual(made.returncode, 0, made.stderr)
        return x, y


class CallsTest(EdgeTestCase):
    def test_a_match_through_it_is_that_of_the_server(self):
        self.start_server()
        self.start_edge()
        x, y = self.pair(400)
        maps = [self.folder / "edge.txt", self.folder / "server.txt"]
        for address, path in zip((self.address, f"unix:{self.folder}/socket"), maps):
            matched = self.isomatch("match", "--server", address, x, y, "-o", path)
            self.assertEqual(matched.returncode, 0, matched.stderr)
        self.assertEqual(maps[0].read_bytes(), maps[1].read_bytes())

    def test_large_messages_and_long_streams_pass(self):
        self.start_server()
        self.start_edge()
        mesh = bytes(range(256)) * (48 << 10)  # 12 MiB
        digest = pb.Digest(sha256=hashlib.sha256(mesh).hexdigest(), size_bytes=len(mesh))

        def messages():
            yield pb.UploadMeshRequest(header=digest)
            for at in range(0, len(mesh), 1 << 20):
                yield pb.UploadMeshRequest(chunk=mesh[at : at + (1 << 20)])

        stub = self.stub()
        stub.UploadMesh(messages(), timeout=PATIENCE_SECONDS)
        missing = stub.FindMissingMeshes(pb.FindMissingMeshesRequest(digests=[digest]), timeout=20)
        self.assertEqual(list(missing.missing), [])

    def test_many_watches_on_a_connection_keep_no_call_waiting(self):
        self.start_server()
        self.start_edge()
        channel = self.channel()
        watch = channel.unary_stream("/grpc.health.v1.Health/Watch")
        watches = [watch(b"", timeout=PATIENCE_SECONDS) for _ in range(200)]
        for health in watches:
            self.assertEqual(next(health), b"\x08\x01")  # SERVING
        stub = service_pb2_grpc.CorrespondenceServiceStub(channel)
        self.assertTrue(stub.GetServerInfo(pb.GetServerInfoRequest(), timeout=20).version)
        for health in watches:
            health.cancel()

    def test_idle_connections_of_others_give_way(self):
        self.start_server()
        self.start_edge({"worker_connections 8000;": "worker_connections 100;"})
        preface = http2_flood.PREFACE + http2_flood.frame(http2_flood.SETTINGS, 0, 0)
        for number in range(600):
            place = {"timeout": PATIENCE_SECONDS, "source_address": ("127.0.0.2", 0)}
            peer = self.enterContext(socket.create_connection(("127.0.0.1", self.port), **place))
            peer.sendall(preface if number % 2 else b"")
        for _ in range(5):
            stub = self.stub()
            self.assertTrue(stub.GetServerInfo(pb.GetServerInfoRequest(), timeout=20).version)

    def test_errors_have_their_details(self):
        self.start_server()
        self.start_edge()
        with self.assertRaises(grpc.RpcError) as caught:
            self.stub().GetJob(pb.GetJobRequest(name="jobs/none"), timeout=20)
        trailers = dict(caught.exception.trailing_metadata())
        self.assertEqual(caught.exception.code(), grpc.StatusCode.NOT_FOUND)
        self.assertIn(b"JOB_NOT_FOUND", trailers["grpc-status-details-bin"])

    def test_without_a_server_calls_are_unavailable_and_go_on_with_one(self):
        self.start_edge()
        stub = self.stub()
        with self.assertRaises(grpc.RpcError) as caught:
            stub.GetServerInfo(pb.GetServerInfoRequest(), timeout=20)
        self.assertEqual(caught.exception.code(), grpc.StatusCode.UNAVAILABLE)
        self.start_server()
        self.assertTrue(stub.GetServerInfo(pb.GetServerInfoRequest(), timeout=20).version)

    def test_a_client_goes_on_when_the_server_is_killed_and_comes_back(self):
        server = self.start_server()
        self.start_edge()
        x, y = self.pair(4000)
        with subprocess.Popen(
            [deployment.CLIENT, "match", "--server", self.address, x, y, "-o", self.folder / "map"],
            env=deployment.environment({}), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        ) as client:  # fmt: skip
            wait_for(lambda: "RUNNING" in self.log.read_text())
            server.kill()
            server.wait()
            self.start_server()
            _, said = client.communicate(timeout=100)
        self.assertEqual(client.returncode, 0, said)


class ClusterTest(EdgeTestCase):
    """Two gateways, of which one is away; here they are two ports, not two addresses."""

    servers = "servers.cluster.conf"

    def setUp(self):
        super().setUp()
        self.gateways = [free_port(), free_port()]

    def server_address(self):
        return f"127.0.0.1:{self.gateways[1]}"

    def upstream(self):
        away, there = (f"server 127.0.0.1:{port}" for port in self.gateways)
        options = re.search(
            r"server gateway:7443( .*;)\n", (ROOT / "docker/edge" / self.servers).read_text()
        ).group(1)
        return {"server gateway:7443": f"{away}{options}\n{there}"}

    def test_calls_go_to_the_gateway_that_is_there(self):
        self.start_server()
        self.start_edge()
        api = self.stub()
        for _ in range(40):
            self.assertTrue(api.GetServerInfo(pb.GetServerInfoRequest(), timeout=20).version)


class TlsTest(EdgeTestCase):
    listen = "listen.tls.conf"

    def setUp(self):
        super().setUp()
        self.tls = self.folder / "tls"
        self.tls.mkdir()

    def make_certificate(self, name):
        """Installs one that is its own authority."""
        subprocess.run(
            ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
             "-nodes", "-days", "2", "-subj", f"/CN={name}", "-addext", "subjectAltName=IP:127.0.0.1",
             "-keyout", self.tls / "new.key", "-out", self.tls / "new.crt"],
            check=True, capture_output=True,
        )  # fmt: skip
        for kind in ("key", "crt"):
            (self.tls / f"new.{kind}").rename(self.tls / f"tls.{kind}")

    def served_certificate(self):
        return ssl.get_server_certificate(("127.0.0.1", self.port)).strip()

    def test_keys_and_certificates_work_and_are_exchanged(self):
        made = subprocess.run(
            [deployment.SERVER, "--new-api-key", "alice", "--tenant", "lab"],
            env=deployment.environment({}), check=True, capture_output=True, text=True,
        )  # fmt: skip
        (self.folder / "keys.txt").write_text(made.stdout)
        (self.folder / "key").write_text(made.stderr)
        self.make_certificate("one")
        self.start_server("--api-keys", self.folder / "keys.txt")
        self.start_edge()
        call = ["list", "--server", self.address, "--tls-ca", self.tls / "tls.crt"]
        refused = self.isomatch(*call)
        self.assertIn("API_KEY_MISSING", refused.stderr)
        listed = self.isomatch(*call, "--api-key-file", self.folder / "key")
        self.assertEqual(listed.returncode, 0, listed.stderr)

        first = self.served_certificate()
        self.make_certificate("two")
        self.assertNotEqual(self.served_certificate(), first)
        self.assertEqual(self.served_certificate(), (self.tls / "tls.crt").read_text().strip())


class FloodTest(EdgeTestCase):
    """The same floods take a server without the edge to 2 GiB in as many seconds."""

    SECONDS = 4

    def honest_calls(self):
        """How long calls of others take, in seconds, during the flood."""
        stub, times = self.stub(), []
        end = time.monotonic() + self.SECONDS
        while time.monotonic() < end or len(times) < 10:
            begin = time.monotonic()
            stub.GetServerInfo(pb.GetServerInfoRequest(), timeout=PATIENCE_SECONDS)
            times.append(time.monotonic() - begin)
            time.sleep(0.02)
        return times

    def expect_no_harm(self, make):
        server = self.start_server()
        self.start_edge()
        with http2_flood.Flood(self.port, make) as flood:
            times = self.honest_calls()
        figures = {
            "sent MiB": flood.sent >> 20,
            "server MiB": peak_bytes(server.pid) >> 20,
            "edge MiB": sum(peak_bytes(pid) for pid in children(self.edge.pid)) >> 20,
            "median ms": round(1000 * statistics.median(times)),
            "slowest ms": round(1000 * max(times)),
        }
        print(make.__name__, figures, flush=True)
        self.assertGreater(flood.sent, 1 << 20)
        self.assertLess(figures["server MiB"], MOST_BYTES >> 20)
        self.assertLess(figures["edge MiB"], MOST_BYTES >> 20)
        self.assertLess(figures["slowest ms"], 1000)

    def test_resets(self):
        self.expect_no_harm(http2_flood.rapid_resets)

    def test_endless_headers(self):
        self.expect_no_harm(http2_flood.endless_headers)


if __name__ == "__main__":
    if NGINX is None:
        raise SystemExit("no nginx: scripts/setup nginx-core")
    deployment.main()
