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
RPC = CORE | {"server/rpc/security", "server/convert", "server/jobs", "server/storage",
              "server/machine", "server/logging", "server/metrics", "proto"}
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
    "server/jobs": CORE | {"server/storage", "server/metrics", "server/machine"},
    "server/convert": CORE | {"server/jobs", "server/storage", "proto"},
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
        {"core/base", "server/machine", "server/jobs", "server/rpc", "server/rpc/security",
         "server/convert", "server/storage",
         "server", "client/api", "client/batch", "client/cli", "client"},
    r"(iostream|fstream|filesystem|cstdlib)$":
        {"server", "server/machine", "server/config", "server/storage", "server/rpc", "client/files",
         "client/batch", "client/cli", "client/cpp", "client"},
}

# What folders alone do not say.
ONLY_CALLER = {"core/pipeline/matcher.h":
               {"server/jobs", "server/convert", "client/inspect", "core/pipeline"}}

INCLUDE = re.compile(r'^\s*#\s*include\s+[<"]([^>"]+)[>"]', re.M)


def layer_of(path):
    parts = re.sub("^isomatch/(?=client/)", "", path).split("/")
    for length in (3, 2, 1):
        layer = "/".join(parts[:length])
        if layer in ALLOWED and len(parts) > length:
            return layer
    return {"proto": "proto", "isomatch": "proto"}.get(parts[0])


def problems_of(name, text):
    layer = layer_of(name)
    for header in INCLUDE.findall(text):
        target = layer_of(header)
        if target and target != layer and target not in ALLOWED[layer]:
            yield f"{name}: {layer} must not include {header} ({target})"
        for pattern, layers in RESTRICTED.items():
            if re.match(pattern, header) and layer not in layers:
                yield f"{name}: {layer} must not include <{header}>"
        if layer not in ONLY_CALLER.get(header, {layer}):
            yield f"{name}: {layer} must not include {header}"


def main(root):
    root = pathlib.Path(root)
    files = sorted(p for top in ("core", "server", "client")
                   for p in (root / top).rglob("*") if p.suffix in (".h", ".cc"))
    found = [problem for p in files
             for problem in problems_of(str(p.relative_to(root)),
                                        p.read_text())]
    print("\n".join(found) or f"{len(files)} files respect the layers")
    # The table must be able to say no.
    assert list(problems_of("core/mesh/x.cc", '#include "core/pipeline/y.h"'))
    assert list(problems_of("core/pipeline/x.cc", "#include <chrono>"))
    assert list(problems_of("server/machine/x.cc", '#include "server/jobs/y.h"'))
    assert list(problems_of("server/rpc/security/x.cc", '#include "server/rpc/y.h"'))
    assert list(problems_of("server/rpc/x.cc", '#include "server/config/y.h"'))
    assert list(problems_of("client/files/x.cc", '#include "client/cli/y.h"'))
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
