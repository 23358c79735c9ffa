#!/usr/bin/env python3
"""Fails when a file includes a layer it must not know (CONTRIBUTING.md, style).

    check_layers.py ROOT

Includes are written from the repository root, so every line names its layer.
"""
import pathlib
import re
import sys

BASE = {"core/base"}
MESH = BASE | {"core/mesh"}
GEODESIC = MESH | {"core/geodesic"}
CORE = GEODESIC | {"core/descriptor", "core/io", "core/matching",
                   "core/spectral", "core/alignment", "core/evaluation", "core/pipeline"}
FILES = {"client/files", "client/picture"}
RPC = CORE | {"server/rpc/security", "server/convert", "server/engine", "server/jobs",
              "server/storage", "server/machine", "server/logging", "server/metrics",
              "proto"}
API = FILES | {"client/api", "proto"}

# Layer -> the layers it may include besides itself.
ALLOWED = {
    "core/base": set(),
    "core/mesh": BASE,
    "core/io": MESH,
    "core/geodesic": MESH,
    "core/descriptor": MESH,
    "core/matching": GEODESIC,
    "core/spectral": MESH,
    "core/alignment": MESH | {"core/spectral"},
    "core/evaluation": GEODESIC,
    "core/pipeline": CORE,
    "server/logging": BASE,
    "server/metrics": BASE,
    "server/machine": BASE,
    "server/storage": BASE | {"server/metrics"},
    "server/engine": CORE | {"server/storage"},
    "server/jobs": CORE | {"server/engine", "server/storage", "server/metrics",
                           "server/machine"},
    "server/convert": CORE | {"server/engine", "server/jobs", "server/storage", "proto"},
    "server/rpc/security": BASE | {"server/jobs"},
    "server/rpc": RPC,
    "server/config": RPC | {"server/rpc"},
    "server": RPC | {"server/rpc", "server/config"},
    "client/picture": MESH,
    "client/files": CORE | {"client/picture"},
    "client/api": CORE | {"proto"},
    "client/job": CORE | API,
    "client/batch": CORE | API | {"client/job"},
    "client/inspect": CORE | FILES | {"proto"},
    "client/transfer": CORE | FILES,
    "client/sample": CORE | FILES,
    "client/viewer": CORE | {"client/picture"},
    "client/cli": CORE | API | {"server", "server/config", "client/batch", "client/inspect",
                                "client/job", "client/sample",
                                "client/transfer", "client/viewer"},
    "client/cpp": API,
    "client": {"client/cli"},
}

# Pattern of an outside header -> the only layers that may include it.
RESTRICTED = {
    r"grpc": {"server/rpc", "server/rpc/security", "server", "client/api", "client/cli", "proto"},
    r"draco/": {"core/io"},
    r"Spectra/": {"core/spectral"},
    r"meshoptimizer\.h": {"core/mesh"},
    r"spdlog": {"server/logging"},
    r"prometheus/": {"server/metrics"},
    r"png\.h$": {"client/picture"},
    # A clock; core/base/mutex.h may wait, but tells no time to core.
    r"(chrono|absl/time/clock\.h|ctime)$":
        {"core/base", "server/logging", "server/machine", "server/jobs", "server/rpc", "server/rpc/security",
         "server/convert", "server/storage",
         "server", "client/api", "client/batch", "client/cli", "client"},
    r"(iostream|fstream|filesystem|cstdlib)$":
        {"server", "server/machine", "server/config", "server/storage", "server/rpc", "client/files",
         "client/batch", "client/cli", "client/cpp", "client"},
}

# What folders alone do not say.
ONLY_CALLER = {"core/pipeline/matcher.h":
               {"server/jobs", "server/convert", "client/inspect", "core/pipeline"}}

# Folder -> floors of its files, the lowest first, without .h and .cc; a file that
# is not named stands on REST. A header includes none of a higher floor. Nor does a
# .cc file, but it may use all of REST: what a word is made of is not in its header.
REST = frozenset()
FLOORS = {
    "core/pipeline": [
        {"correspondence", "joined_progress", "match_options", "memory_estimate",
         "prepared_shape", "progress", "verdict"},  # what the other folders speak of
        REST,
        {"match_engine", "matcher", "shape_matching"},
    ],
    "server/rpc": [
        {"connection_table", "grpc_status", "raw_message", "refusals",
         "service_context"},
        REST,
        {"accept_loop", "create_job", "download_result", "upload_mesh", "watch_job"},
        {"correspondence_service"},
    ],
}

INCLUDE = re.compile(r'^\s*#\s*include\s+[<"]([^>"]+)[>"]', re.M)


def layer_of(path):
    parts = re.sub("^isomatch/(?=client/)", "", path).split("/")
    for length in (3, 2, 1):
        layer = "/".join(parts[:length])
        if layer in ALLOWED and len(parts) > length:
            return layer
    return {"proto": "proto", "isomatch": "proto"}.get(parts[0])


def floor_of(name):
    folder, _, file = name.rpartition("/")
    floors = FLOORS.get(folder)
    if floors is None:
        return 0
    stem = file.rpartition(".")[0]
    rest = floors.index(REST)
    floor = next((i for i, names in enumerate(floors) if stem in names), rest)
    return max(floor, rest) if file.endswith(".cc") else floor


def problems_of(name, text):
    layer = layer_of(name)
    for header in INCLUDE.findall(text):
        target = layer_of(header)
        if target and target != layer and target not in ALLOWED[layer]:
            yield f"{name}: {layer} must not include {header} ({target})"
        for pattern, layers in RESTRICTED.items():
            if re.match(pattern, header) and layer not in layers:
                yield f"{name}: {layer} must not include <{header}>"
        if target == layer and floor_of(header) > floor_of(name):
            yield f"{name}: must not include {header}, of a higher floor of {layer}"
        if layer not in ONLY_CALLER.get(header, {layer}):
            yield f"{name}: {layer} must not include {header}"


def missing_of(files):
    """Yields what FLOORS names and is not there."""
    stems = {name.rpartition(".")[0] for name in files}
    for folder, floors in FLOORS.items():
        for name in sorted(set().union(*floors)):
            if f"{folder}/{name}" not in stems:
                yield f"{folder}/{name}: a floor of check_layers.py names it, but no file is there"


def check_itself():
    """The tables must be able to say no."""
    def fails(name, header):
        return bool(list(problems_of(name, f"#include {header}")))
    assert fails("core/mesh/x.cc", '"core/pipeline/y.h"')
    assert fails("core/pipeline/x.cc", "<chrono>")
    assert fails("server/machine/x.cc", '"server/jobs/y.h"')
    assert fails("server/rpc/security/x.cc", '"server/rpc/y.h"')
    assert fails("server/rpc/x.cc", '"server/config/y.h"')
    assert fails("server/config/x.cc", '"server/server.h"')
    assert fails("client/files/x.cc", '"client/cli/y.h"')
    # Floors of one folder.
    assert fails("core/pipeline/progress.h", '"core/pipeline/prepared_mesh.h"')
    assert fails("core/pipeline/prepared_mesh.cc", '"core/pipeline/matcher.h"')
    assert fails("server/rpc/upload_mesh.cc", '"server/rpc/correspondence_service.h"')
    assert not fails("core/pipeline/prepared_mesh.h", '"core/pipeline/progress.h"')
    assert not fails("core/pipeline/memory_estimate.cc", '"core/pipeline/prepared_mesh.h"')
    assert list(missing_of(["core/pipeline/matcher.h"]))


def main(root):
    check_itself()
    root = pathlib.Path(root)
    files = sorted(p for top in ("core", "server", "client")
                   for p in (root / top).rglob("*") if p.suffix in (".h", ".cc"))
    found = [problem for p in files
             for problem in problems_of(str(p.relative_to(root)),
                                        p.read_text())]
    found += missing_of([str(p.relative_to(root)) for p in files])
    print("\n".join(found) or f"{len(files)} files respect the layers")
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
