"""One version: CMakeLists.txt, --version of both programs, GetServerInfo, packages."""

import re
import signal
import subprocess
import unittest

import grpc

import deployment
from isomatch.v1 import service_pb2 as pb
from isomatch.v1 import service_pb2_grpc


class VersionTest(unittest.TestCase):
    def setUp(self):
        self.version = deployment.project_version()

    def test_both_programs_say_it(self):
        for program, name in (
            (deployment.SERVER, "isomatch-server"),
            (deployment.CLIENT, "isomatch"),
        ):
            said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
            self.assertEqual(said.stdout, f"{name} {self.version}\n")

    def test_the_packages_of_other_languages_say_it(self):
        for path, pattern in (
            ("client/python/pyproject.toml", r'^version = "(.*)"$'),
            ("client/python/isomatch/__init__.py", r'^__version__ = "(.*)"$'),
            ("client/node/package.json", r'^  "version": "(.*)",$'),
        ):
            text = (deployment.ROOT / path).read_text()
            self.assertEqual(re.findall(pattern, text, re.MULTILINE), [self.version], path)

    def test_the_service_says_it(self):
        free_port = {"ISOMATCH_LISTEN": "127.0.0.1:0", "ISOMATCH_METRICS_LISTEN": "off"}
        with subprocess.Popen(
            [deployment.SERVER, "--ephemeral"],
            env=deployment.environment(free_port),
            stderr=subprocess.PIPE,
            text=True,
        ) as server:
            try:
                started = re.search(r"isomatch-server (\S+) listens on (\S+)", server.stderr.readline())
                api = service_pb2_grpc.CorrespondenceServiceStub(
                    grpc.insecure_channel(started.group(2))
                )
                info = api.GetServerInfo(pb.GetServerInfoRequest(), timeout=20)
            finally:
                server.send_signal(signal.SIGTERM)
        self.assertEqual(started.group(1), self.version)
        self.assertEqual(info.version, self.version)


if __name__ == "__main__":
    deployment.main()
