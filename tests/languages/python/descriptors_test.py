"""The API's files: service.binpb, which the package reads the API from, is that of
service.proto, the Node client has a copy of that, and gRPC understands service_config.json."""

import concurrent.futures
import importlib.resources
import json
import os
import pathlib
import subprocess
import unittest

import grpc
import support
from google.protobuf import any_pb2, descriptor_pb2, descriptor_pool, duration_pb2

import isomatch
from isomatch import _messages

FILES = [
    "isomatch/v1/service.proto",
    "google/rpc/status.proto",
    "google/rpc/error_details.proto",
]


class DescriptorsTest(unittest.TestCase):
    def test_the_committed_descriptors_are_those_of_the_proto(self):
        path = support.folder() / "service.binpb"
        proto = pathlib.Path(os.environ["ISOMATCH_PROTO"])
        subprocess.run(
            [os.environ["ISOMATCH_PROTOC"], f"--proto_path={proto}", "--include_imports",
             f"--descriptor_set_out={path}", *FILES],
            check=True,
        )  # fmt: skip
        packaged = importlib.resources.files("isomatch").joinpath("service.binpb")
        sets = [
            descriptor_pb2.FileDescriptorSet.FromString(data)
            for data in (path.read_bytes(), packaged.read_bytes())
        ]
        self.assertEqual(
            *sets, "build the target python_descriptors and commit client/python/isomatch"
        )

    def test_the_copy_in_the_node_client_is_that_of_the_proto(self):
        proto = pathlib.Path(os.environ["ISOMATCH_PROTO"]) / "isomatch/v1/service.proto"
        copy = pathlib.Path(os.environ["ISOMATCH_NODE_CLIENT"]) / "service.proto"
        self.assertTrue(
            proto.read_bytes() == copy.read_bytes(),
            "build the target python_descriptors and commit client/node/service.proto",
        )

    def test_stubs_of_the_same_files_do_not_clash(self):
        # As another package of the user's program may have them, of another age.
        data = importlib.resources.files("isomatch").joinpath("service.binpb").read_bytes()
        # What those import, and the package is there already.
        self.assertTrue(any_pb2.DESCRIPTOR and duration_pb2.DESCRIPTOR and isomatch.match)
        for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
            if file.package == "google.rpc":
                file.message_type[0].field.add(name="newer", number=99, type=9, label=1)
                descriptor_pool.Default().AddSerializedFile(file.SerializeToString())
        found = descriptor_pool.Default().FindMessageTypeByName("google.rpc.Status")
        self.assertIn("newer", found.fields_by_name)


class FlakyServer(grpc.GenericRpcHandler):
    """Answers UNAVAILABLE twice, then OK."""

    def __init__(self):
        self.calls = 0

    def service(self, details):
        def answer(request, context):
            self.calls += 1
            if self.calls <= 2:
                context.abort(grpc.StatusCode.UNAVAILABLE, "away")
            return b""

        return grpc.unary_unary_rpc_method_handler(answer)


class ServiceConfigTest(unittest.TestCase):
    def setUp(self):
        path = pathlib.Path(os.environ["ISOMATCH_PROTO"]) / "isomatch/v1/service_config.json"
        self.text = path.read_text()

    def test_it_names_the_rpcs_that_are_always_safe_to_send_again(self):
        service = "isomatch.v1.CorrespondenceService"
        (config,) = json.loads(self.text)["methodConfig"]
        self.assertEqual({name["service"] for name in config["name"]}, {service})
        self.assertEqual(
            {name["method"] for name in config["name"]},
            {
                method.name
                for method in _messages.service_methods()
                if not method.client_streaming and not method.server_streaming
            }
            - {"CreateJob"},  # safe with a request_id only
        )

    def test_grpc_tries_again_as_it_says(self):
        flaky = FlakyServer()
        server = grpc.server(concurrent.futures.ThreadPoolExecutor(1))
        server.add_generic_rpc_handlers([flaky])
        port = server.add_insecure_port("127.0.0.1:0")
        server.start()
        self.addCleanup(server.stop, None)
        method = "/isomatch.v1.CorrespondenceService/GetServerInfo"
        options = [("grpc.service_config", self.text)]
        with grpc.insecure_channel(f"127.0.0.1:{port}", options) as channel:
            self.assertEqual(channel.unary_unary(method)(b""), b"")
        self.assertEqual(flaky.calls, 3)
        flaky.calls = 0
        with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
            with self.assertRaises(grpc.RpcError):
                channel.unary_unary(method)(b"")


if __name__ == "__main__":
    unittest.main()
