#!/usr/bin/env python3
"""Fails when a file includes a layer it must not know (CONTRIBUTING.md, style).

    check_layers.py ROOT

Includes are written from the repository root, so every line names its layer.
"""
import pathlib
import re
import sys

# Layer -> the layers it includes besides itself. Each stands below it in this
# table, so that arrows point downwards only; what is not used any more has to go.
ALLOWED = {layer: used.split() for layer, used in {
    "proto": "",
    "core/base": "",
    "core/mesh": "core/base",
    "core/io": "core/base core/mesh",
    "core/geodesic": "core/base core/mesh",
    "core/descriptor": "core/base core/mesh",
    "core/matching": "core/base core/mesh core/geodesic",
    "core/spectral": "core/base core/mesh",
    "core/alignment": "core/base core/mesh core/spectral",
    "core/evaluation": "core/base core/mesh core/geodesic",
    "core/pipeline": "core/base core/mesh core/geodesic core/descriptor core/matching"
                     " core/spectral core/alignment core/evaluation",
    "server/logging": "",
    "server/metrics": "",
    "server/machine": "core/base",
    "server/storage": "core/base",
    "server/postgres": "core/base server/storage",
    "server/engine": "core/base core/mesh core/io core/pipeline server/storage",
    "server/jobs": "core/base core/mesh core/pipeline server/metrics server/machine"
                   " server/storage server/engine",
    "server/convert": "proto core/base core/mesh core/io core/pipeline server/storage"
                      " server/engine server/jobs",
    "server/rpc/security": "core/base server/jobs",
    "server/rpc": "proto core/base server/logging server/metrics server/storage server/jobs"
                  " server/convert server/rpc/security",
    "server/config": "core/base server/machine server/jobs server/convert"
                     " server/rpc/security server/rpc",
    "server": "core/base core/pipeline server/logging server/metrics server/machine"
              " server/storage server/postgres server/engine server/jobs server/convert"
              " server/rpc/security server/rpc server/config",
    "client/picture": "core/mesh",
    "client/files": "core/base core/mesh core/io client/picture",
    "client/api": "proto core/base core/mesh core/io",
    "client/job": "proto core/base core/mesh core/io core/evaluation core/pipeline client/files"
                  " client/api",
    "client/batch": "core/base client/files client/api client/job",
    "client/inspect": "proto core/base core/mesh core/io core/pipeline client/files",
    "client/transfer": "core/base core/mesh core/geodesic client/files",
    "client/sample": "core/base core/mesh client/picture client/files",
    "client/viewer": "core/base core/mesh core/io core/evaluation client/picture",
    "client/cli": "proto core/base core/mesh core/pipeline server/config server client/picture client/files"
                  " client/api client/job client/batch client/inspect client/transfer"
                  " client/sample client/viewer",
    "client/cpp": "client/files client/api",
    "client/c": "core/base core/mesh core/io core/pipeline client/files client/transfer client/viewer",
    "client/c/examples": "",
    "client": "client/cli",
}.items()}

# Pattern of an outside header -> the only layers that may include it.
RESTRICTED = {
    r"grpc": {"server/rpc", "server/rpc/security", "server", "client/api", "client/cli", "proto"},
    r"draco/": {"core/io"},
    r"Spectra/": {"core/spectral"},
    r"meshoptimizer\.h": {"core/mesh"},
    r"spdlog": {"server/logging"},
    r"prometheus/": {"server/metrics"},
    r"png\.h$": {"client/picture"},
    r"(tiny_gltf\.h|pugixml\.hpp|zlib\.h)$": {"client/files"},
    r"pqxx/": {"server/postgres"},
    # A clock; core/base/mutex.h may wait, but tells no time to core.
    r"(chrono|absl/time/clock\.h|ctime)$":
        {"core/base", "server/logging", "server/machine", "server/jobs", "server/rpc", "server/rpc/security",
         "server/convert", "server/storage", "server/postgres",
         "server", "client/api", "client/batch", "client/cli", "client/c", "client"},
    r"(iostream|fstream|filesystem|cstdlib)$":
        {"server", "server/machine", "server/config", "server/storage", "server/rpc", "client/files",
         "client/batch", "client/cli", "client/cpp", "client/c/examples", "client"},
}

# What folders alone do not say: who may run the method.
ONLY_CALLER = {"core/pipeline/matcher.h": {"server/jobs", "core/pipeline", "client/c"},
               "core/pipeline/match_engine.h":
               {"server/engine", "server/jobs", "server", "core/pipeline"}}

# Folder -> floors of its files, the lowest first, without .h and .cc. A file includes
# none of a higher floor, but for the .cc files of the lowest one, which use all but
# the highest: what a word is made of is not in its header.
FLOORS = {folder: [set(names.split()) for names in floors] for folder, floors in {
    "core/pipeline": [
        # What other folders speak of.
        "correspondence instruction_set joined_progress match_options memory_estimate"
        " prepared_shape progress verdict",
        "memory_plan progress_reporter stage_plan",
        "candidates prepared_mesh",
        "candidate_choice component_matching confidence counterpart_rule landmarks lifting"
        " part_start preparation relation_search torn_maps user_numbering",
        "conclusion prepared_shape_io quality_report shape_contents",
        "match_run",
        "match_engine matcher shape_matching",
    ],
    "server/rpc": [
        "call_interceptor channel_arguments connection_table grpc_logging grpc_plugins"
        " grpc_status health_probe listening_sockets raw_message refusals refused"
        " service_context",
        "accept_loop create_job download_result upload_mesh watch_job",
        "correspondence_service",
    ],
}.items()}

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
    stem = file.rpartition(".")[0]
    floors = FLOORS.get(folder)
    if floors is None:
        return 0
    floor = next((i for i, names in enumerate(floors) if stem in names), 0)
    return len(floors) - 2 if file.endswith(".cc") and floor == 0 else floor


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


def mismatches_of(files):
    """Yields where FLOORS and the files of its folders differ."""
    for folder, floors in FLOORS.items():
        named = set().union(*floors)
        there = {name.rpartition("/")[2].rpartition(".")[0] for name in files
                 if name.rpartition("/")[0] == folder}
        for name in sorted(named - there):
            yield f"{folder}/{name}: a floor of check_layers.py names it, but no file is there"
        for name in sorted(there - named):
            yield f"{folder}/{name}: no floor of check_layers.py names it"


def unused_of(texts, allowed):
    """Yields arrows that no include draws, and those that point upwards."""
    used = {(layer_of(name), layer_of(header))
            for name, text in texts.items() for header in INCLUDE.findall(text)}
    below = set()
    for layer, targets in allowed.items():
        for target in targets:
            if (layer, target) not in used:
                yield f"check_layers.py: {layer} includes nothing of {target} any more"
            if target not in below:
                yield f"check_layers.py: {target} does not stand below {layer}"
        below.add(layer)


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
    assert fails("core/pipeline/memory_estimate.cc", '"core/pipeline/matcher.h"')
    assert fails("core/pipeline/landmarks.cc", '"core/pipeline/match_run.h"')
    assert fails("server/convert/x.cc", '"core/pipeline/matcher.h"')
    named = {f"{folder}/{name}.h" for folder, floors in FLOORS.items()
             for name in set().union(*floors)}
    assert not list(mismatches_of(named))
    assert list(mismatches_of(named - {"core/pipeline/matcher.h"}))
    assert list(mismatches_of(named | {"core/pipeline/x.cc"}))
    # An arrow that nothing draws, and one upwards.
    drawn = {"core/mesh/x.cc": '#include "core/base/y.h"'}
    tables = [{"core/base": [], "core/mesh": ["core/base"]}, {"core/mesh": ["core/base"]}]
    assert [bool(list(unused_of(drawn, table))) for table in tables] == [False, True]
    assert list(unused_of({}, tables[0]))


def main(root):
    check_itself()
    root = pathlib.Path(root)
    texts = {str(p.relative_to(root)): p.read_text()
             for top in ("core", "server", "client")
             for p in sorted((root / top).rglob("*")) if p.suffix in (".h", ".cc")}
    found = [problem for name, text in texts.items() for problem in problems_of(name, text)]
    found += [*mismatches_of(texts), *unused_of(texts, ALLOWED)]
    print("\n".join(found) or f"{len(texts)} files respect the layers")
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
