"""What protoc and its plugins make of the API's files for other languages, and the
recipes of proto/README.md for it, run as they stand there."""

import os
import pathlib
import subprocess
import unittest

import support

PROTO = pathlib.Path(os.environ["ISOMATCH_PROTO"])
FILES = sorted(str(path.relative_to(PROTO)) for path in PROTO.rglob("*.proto"))

# By language: a generated file of each of ours, and what it says of its names.
GENERATED = {
    "go": {
        "isomatch/v1/service.pb.go": "package isomatchv1\n",
        "google.golang.org/genproto/googleapis/rpc/status/status.pb.go": "package status\n",
        "google.golang.org/genproto/googleapis/rpc/errdetails/error_details.pb.go":
            "package errdetails\n",
        "google.golang.org/grpc/health/grpc_health_v1/health.pb.go": "package grpc_health_v1\n",
    },
    "go-grpc": {
        "isomatch/v1/service_grpc.pb.go": "type CorrespondenceServiceClient interface",
        "google.golang.org/grpc/health/grpc_health_v1/health_grpc.pb.go": "HealthClient",
    },
    "java": {
        "isomatch/v1/CreateJobRequest.java": "package isomatch.v1;",
        "isomatch/v1/ServiceProto.java": "package isomatch.v1;",
        "com/google/rpc/Status.java": "package com.google.rpc;",
        "com/google/rpc/ErrorInfo.java": "package com.google.rpc;",
        "io/grpc/health/v1/HealthCheckRequest.java": "package io.grpc.health.v1;",
    },
    "csharp": {
        "Service.cs": "namespace Isomatch.V1 {",
        "Status.cs": "namespace Google.Rpc {",
        "ErrorDetails.cs": "namespace Google.Rpc {",
        "Health.cs": "namespace Grpc.Health.V1 {",
    },
    "php": {
        "Isomatch/V1/CreateJobRequest.php": "namespace Isomatch\\V1;",
        "Google/Rpc/Status.php": "namespace Google\\Rpc;",
        "Google/Rpc/ErrorInfo.php": "namespace Google\\Rpc;",
        "Grpc/Health/V1/HealthCheckRequest.php": "namespace Grpc\\Health\\V1;",
    },
    "ruby": {
        "isomatch/v1/service_pb.rb": "module Isomatch",
        "google/rpc/status_pb.rb": "module Google",
        "google/rpc/error_details_pb.rb": "module Google",
        "grpc/health/v1/health_pb.rb": "module Grpc",
    },
    "objc": {
        "isomatch/v1/Service.pbobjc.h": "@interface ISMCreateJobRequest",
        "google/rpc/Status.pbobjc.h": "@interface RPCStatus",
        "google/rpc/ErrorDetails.pbobjc.h": "@interface RPCErrorInfo",
        "grpc/health/v1/Health.pbobjc.h": "@interface GrpcHealthV1HealthCheckRequest",
    },
    "python": {
        "isomatch/v1/service_pb2.py": "isomatch.v1",
        "grpc/health/v1/health_pb2.py": "grpc.health.v1",
    },
}  # fmt: skip


class GeneratedCodeTest(unittest.TestCase):
    def test_every_file_is_generated_with_the_names_of_its_language(self):
        for language, expected in GENERATED.items():
            with self.subTest(language=language):
                out = support.folder() / language
                out.mkdir()
                subprocess.run(
                    [os.environ["ISOMATCH_PROTOC"], f"--proto_path={PROTO}",
                     f"--{language}_out={out}", *FILES],
                    check=True,
                )  # fmt: skip
                for name, said in expected.items():
                    self.assertTrue(said in (out / name).read_text(), f"{name}: no {said}")

    def test_the_recipes_of_the_manual_work(self):
        [script] = support.blocks(PROTO / "README.md", "In other languages", "sh")
        folder = support.folder() / "recipes"
        folder.mkdir()
        (folder / "proto").symlink_to(PROTO)
        subprocess.run(["bash", "-c", "set -euo pipefail\n" + script], check=True, cwd=folder)
        made = {path.name: path for path in folder.joinpath("gen").rglob("*")}
        for name in ("service.pb.go", "service_grpc.pb.go", "CreateJobRequest.java", "Service.cs"):
            self.assertIn(name, made)
        # In the user's own module.
        self.assertEqual(made["service.pb.go"].parent, folder / "gen/isomatchv1")


if __name__ == "__main__":
    unittest.main()
