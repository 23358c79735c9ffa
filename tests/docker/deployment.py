"""What the tests of docker/ share: the server as judge of settings."""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
IMAGE_CONFIG = ROOT / "docker/server.toml"

# Of the memory of a container, what the server lets jobs reserve at most.
BUDGET_SHARE = 0.8
# What stopping may take beyond the drain timeout, in seconds.
LAST_SECONDS = 1

SIZES = {"B": 1, "KiB": 1 << 10, "MiB": 1 << 20, "GiB": 1 << 30, "TiB": 1 << 40}
TIMES = {"ms": 0.001, "s": 1, "m": 60, "h": 3600}

SERVER = os.environ.get("ISOMATCH_SERVER_BINARY", "")
CLIENT = os.environ.get("ISOMATCH_CLIENT_BINARY", "")
NODE = os.environ.get("ISOMATCH_NODE", "")
# tests/docker/npm with its packages.
NODE_FOLDER = os.environ.get("ISOMATCH_NODE_FOLDER", "")


# Metrics that only processes with --store need to export, without labels: the same at
# each of them but for the two counters.
CLUSTER_METRICS = [
    "isomatch_claims_total",
    "isomatch_cluster_jobs_queued",
    "isomatch_cluster_jobs_running",
    "isomatch_database_dead_rows",
    "isomatch_database_oldest_transaction_seconds",
    "isomatch_database_up",
    "isomatch_leases_expired_total",
    "isomatch_queue_oldest_seconds",
    "isomatch_workers_registered",
]


def environment(settings):
    """Returns this process's environment with these ISOMATCH_ variables and no others."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("ISOMATCH")}
    return {**clean, **settings}


def ask_server(arguments, settings):
    return subprocess.run(
        [SERVER, *arguments], env=environment(settings), capture_output=True, text=True, timeout=60
    )


def ask_node(script, question):
    """Returns the answer of a script of tests/docker/npm; both are JSON."""
    answer = subprocess.run(
        [NODE, script], cwd=NODE_FOLDER, input=json.dumps(question), capture_output=True, text=True,
        timeout=60,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout)


def effective(config, settings):
    """Returns what a configuration comes to, key by key, without quotes.

    Fails when the server refuses it, or a variable is none of its flags.
    """
    flags = ask_server(["--help"], {}).stdout
    for name in settings:
        assert f"Env:{name})" in flags, f"{name} is no variable of isomatch-server"
    answer = ask_server(["--config", str(config), "--print-config"], settings)
    assert answer.returncode == 0, answer.stderr
    lines = re.findall(r"^([a-z-]+) = (.*)$", answer.stdout, re.MULTILINE)
    return {key: value.strip('"') for key, value in lines}


def effective_text(text, settings):
    """As effective(), of a configuration file with this text."""
    with tempfile.TemporaryDirectory() as folder:
        config = pathlib.Path(folder) / "server.toml"
        config.write_text(text)
        return effective(config, settings)


def size(text):
    number, unit = re.fullmatch(r"(\d+)([A-Za-z]*)", str(text)).groups()
    units = {**SIZES, "": 1, "Ki": 1 << 10, "Mi": 1 << 20, "Gi": 1 << 30, "g": 1 << 30, "m": 1 << 20}
    return int(number) * units[unit]


def seconds(text):
    parts = re.findall(r"(\d+)(ms|s|m|h)", text)
    assert parts and "".join(map("".join, parts)) == text, f"{text} is no time"
    return sum(int(number) * TIMES[unit] for number, unit in parts)


def port(address):
    return int(address.rsplit(":", 1)[1])


def documents(path):
    return list(yaml.safe_load_all(path.read_text()))


def project_version():
    text = (ROOT / "CMakeLists.txt").read_text()
    return re.search(r"^project\(isomatch VERSION (\S+)", text, re.MULTILINE).group(1)


def main():
    if not (SERVER and CLIENT):
        sys.exit("set ISOMATCH_SERVER_BINARY and ISOMATCH_CLIENT_BINARY, as ctest does")
    unittest.main()
