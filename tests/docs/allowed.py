"""Commands of the manuals that no test runs: why not, and what is looked at instead."""

import dataclasses
import json
import re
import subprocess
import tempfile
import typing

import programs
from readme import ROOT

# Options of `docker run`, with whether a value follows.
DOCKER_RUN = {
    "--rm": False, "--read-only": False, "--cap-drop": True, "--security-opt": True,
    "-v": True, "--tmpfs": True, "-p": True, "-e": True, "--user": True,
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Allowed:
    """Commands that begin with these words."""

    start: str
    why: str
    check: typing.Callable  # of the words, returns a list of what is wrong

    def matches(self, words):
        start = self.start.split()
        return words[: len(start)] == start


def read(path):
    return (ROOT / path).read_text()


def check_paths(words):
    """Names of this repository's files exist; those below build/ are made."""
    named = [word.removeprefix("./") for word in words[1:] if re.match(r"[\w./-]+/", word)]
    return [f"there is no {name}" for name in named
            if not name.startswith(("build/", "/")) and not (ROOT / name).exists()]  # fmt: skip


def check_apt(words):
    """Packages are in docker/packages.txt, or what scripts/package makes."""
    lists = read("docker/debian/CMakeLists.txt")
    made = re.findall(r"set\(CPACK_DEBIAN_\w+_PACKAGE_NAME (\S+)\)", lists)
    known = read("docker/packages.txt").split() + [f"./build/package/{name}_*.deb" for name in made]
    packages = words[words.index("install") + 1 :]
    return [f"{name} is neither in docker/packages.txt nor of scripts/package"
            for name in packages if name not in known]  # fmt: skip


def check_fetch_sets(words):
    """Sets are those of tests/bench/public_sets.py, flags those of scripts/bench."""
    sets = re.findall(r'^    "(\w+)": PublicSet', read("tests/bench/public_sets.py"), re.MULTILINE)
    named = [word for word in words[4:] if not word.startswith("-")]
    return programs.check_script(words) + [
        f"fetch-sets knows no set {name}" for name in named if name not in sets
    ]


def check_unit(words):
    unit = ROOT / f"docker/debian/{words[-1]}.service.in"
    return [] if unit.is_file() else [f"docker/debian has no unit {words[-1]}"]


def check_kubectl(words):
    """Files exist; objects are those of the manifests, or of the chart's release."""
    folder = ROOT / "docker/kubernetes"
    manifests = "".join(path.read_text() for path in folder.glob("*.yaml"))
    manifests += read("docker/helm/cloudnative-pg.yaml")
    kinds = r"(statefulset|service|cluster)/"
    files = [word for word in words if "=" not in word and not re.match(kinds, word)]
    names = [word.split("/")[-1] for word in words if word.split("/")[-1].startswith("isomatch")]
    return check_paths(files) + [
        f"docker/kubernetes names no {name}"
        for name in names
        if not re.search(rf"[nN]ame: {name}$|namespace: {name}$", manifests, re.MULTILINE)
    ]


def schema_has(keys):
    """Whether the chart's schema has a value."""
    node = json.loads(read("docker/helm/isomatch/values.schema.json"))
    for key in keys:
        node = node.get("properties", {}).get(key)
        if node is None:
            return False
    return True


def check_helm(words):
    """Our chart exists, and its schema has the values that are set."""
    problems = check_paths([word for word in words if word.startswith("docker/")])
    if "docker/helm/isomatch" in words:
        sets = [value for flag, value in zip(words, words[1:]) if flag == "--set"]
        problems += [f"the chart has no value {value}" for value in sets
                     if not schema_has(value.partition("=")[0].split("."))]  # fmt: skip
    return problems


def check_kind(words):
    """Images are those of docker/build, of this version."""
    version = re.search(r"^project\(isomatch VERSION (\S+)", read("CMakeLists.txt"), re.M).group(1)
    images = [word for word in words if ":" in word]
    known = [f"isomatch-{name}:{version}" for name in ("server", "edge")]
    return [f"docker/build makes no {image}" for image in images if image not in known]


def check_compose(words):
    """Files exist; services and profiles are those of compose.yaml."""
    text = read("docker/compose.yaml")
    services = re.findall(r"^  ([a-z-]+):$", text, re.MULTILINE)
    pairs = list(zip(words, words[1:]))
    scaled = [value.partition("=")[0] for flag, value in pairs if flag == "--scale"]
    scaled += [value for command, value in pairs if command == "restart"]
    profiles = [value for flag, value in pairs if flag == "--profile"]
    return check_paths(words) + [
        f"compose.yaml has no service {name}" for name in scaled if name not in services
    ] + [f"compose.yaml has no profile {name}" for name in profiles
         if f"profiles: [{name}]" not in text]  # fmt: skip


def check_ctest(words):
    """--preset names a preset, -L a label."""
    lists = "".join(path.read_text() for path in (ROOT / "tests").rglob("CMakeLists.txt"))
    labels = [value for flag, value in zip(words, words[1:]) if flag == "-L"]
    return programs.check_presets(words) + [
        f"no test has the label {label}"
        for label in labels
        if not re.search(rf"LABELS? {label.strip('^$')}\b", lists)
    ]


def check_build(words):
    """--preset names a preset, --target a target."""
    return programs.check_presets(words) + check_targets(
        [value for flag, value in zip(words, words[1:]) if flag == "--target"]
    )


def check_targets(names):
    folders = ("core", "server", "client", "proto", "tests")
    lists = "".join(path.read_text() for folder in folders
                    for path in (ROOT / folder).rglob("CMakeLists.txt"))  # fmt: skip
    return [f"there is no target {name}" for name in names
            if not re.search(rf"\({name}\s", lists)]  # fmt: skip


def check_test_binary(words):
    """The binary is a target, the suite of --gtest_filter in a test."""
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("*_test.cc"))
    suites = re.findall(r"--gtest_filter='?(\w+)", " ".join(words))
    return check_targets([words[0].rpartition("/")[2]]) + [
        f"there is no suite {suite}" for suite in suites if f"({suite}," not in tests
    ]


def check_component(words):
    """What follows --component is one."""
    components = re.search(r"set\(components (.*)\)", read("docker/debian/CMakeLists.txt")).group(1)
    named = [value for flag, value in zip(words, words[1:]) if flag == "--component"]
    return [f"there is no component {name}" for name in named if name not in components.split()]


def run_arguments(words):
    """Returns the options of a `docker run` as pairs, and what follows them."""
    options, rest = [], list(words[2:])
    while rest and rest[0].startswith("-"):
        name = rest.pop(0)
        options.append((name, rest.pop(0) if DOCKER_RUN.get(name) else ""))
    return options, rest


def check_docker_run(words):
    """The images are ours, their settings and arguments ones that our programs take,
    volumes and ports those of the image."""
    options, (image, *arguments) = run_arguments(words)
    unknown = [name for name, _ in options if name not in DOCKER_RUN]
    problems = [f"the tests know no docker run {name}" for name in unknown]
    if image not in ("isomatch", "isomatch-server"):
        problems.append(f"docker/build makes no image {image}")
    if image == "isomatch-server" and not arguments:
        problems += check_server_container(options)
    return problems + programs.check_program([image, *arguments])


def check_server_container(options):
    """The image's server accepts the settings and finds its volume and its files."""
    settings = dict(value.split("=", 1) for name, value in options if name == "-e")
    flags = programs.help_text(programs.SERVER)
    unknown = [name for name in settings if f"Env:{name})" not in flags]
    problems = [f"isomatch-server has no {name}" for name in unknown]
    with tempfile.TemporaryDirectory() as home:
        answer = subprocess.run(
            [programs.SERVER, "--config", ROOT / "docker/server.toml", "--print-config"],
            env={**programs.environment(home), **settings}, capture_output=True, text=True,
            timeout=60,
        )  # fmt: skip
    if answer.returncode:
        return [*problems, answer.stderr]
    config = dict(re.findall(r"^([a-z-]+) = \"?(.*?)\"?$", answer.stdout, re.MULTILINE))
    ports = [value.split(":")[-1] for name, value in options if name == "-p"]
    if ports != [config["listen"].split(":")[-1]]:
        problems.append(f"-p opens {ports}, the server listens on {config['listen']}")
    mounted = {value.split(":")[1] for name, value in options if name == "-v"}
    files = [value for value in settings.values() if value.startswith("/")]
    needed = {config["data-dir"], *(name.rpartition("/")[0] for name in files)}
    return problems + [f"-v mounts no {folder}" for folder in sorted(needed - mounted)]


def check_grpcurl(words):
    """Flags are grpcurl's, what is called or described is in service.proto, requests
    are JSON."""
    proto = read("proto/isomatch/v1/service.proto")
    flags = [word for word in words if word.startswith("-")]
    problems = [f"the tests know no grpcurl {flag}" for flag in flags
                if flag not in ("-plaintext", "-d")]  # fmt: skip
    for data in [value for flag, value in zip(words, words[1:]) if flag == "-d" and value != "@"]:
        json.loads(data)
    for name in re.findall(r"isomatch\.v1\.(\S+)", " ".join(words)):
        service, _, rpc = name.rpartition("/")
        kind = rf"service {service} " if service else rf"message {rpc} "
        if not re.search(kind, proto) or (service and f"rpc {rpc}(" not in proto):
            problems.append(f"service.proto has no {name}")
    return problems


ALLOWED = [
    Allowed("scripts/demo", "builds the release preset", programs.check_script),
    Allowed("scripts/test", "builds everything and runs this test", programs.check_script),
    Allowed("scripts/setup", "installs Debian packages", programs.check_script),
    Allowed("scripts/package", "builds the Debian packages", programs.check_script),
    Allowed("scripts/bench fetch-sets", "needs clones of other repositories", check_fetch_sets),
    Allowed("scripts/bench view", "needs Chromium", programs.check_script),
    Allowed("scripts/bench", "measures for minutes", programs.check_bench),
    Allowed("tests/bench/part_pictures", "needs the release build", programs.check_script),
    Allowed("scripts/cluster", "stays until Ctrl-C", programs.check_script),
    Allowed("docker/build", "needs docker, podman or buildah", programs.check_script),
    Allowed("docker/smoke-test", "needs root and the Debian mirror", programs.check_script),
    Allowed("docker/debian/smoke-test", "needs root and the Debian mirror", programs.check_script),
    Allowed("cmake --preset", "configures a build", programs.check_presets),
    Allowed("cmake --build", "builds", check_build),
    Allowed("cmake --install", "installs", check_component),
    Allowed("ctest", "runs this test", check_ctest),
    Allowed("build/dev/bin/core_mesh_test", "a test of its own", check_test_binary),
    Allowed("server_binary_test", "a test of its own", check_test_binary),
    Allowed("docker run", "needs a Docker daemon", check_docker_run),
    Allowed("docker compose", "needs a Docker daemon", check_compose),
    Allowed("kubectl", "needs a cluster", check_kubectl),
    Allowed("helm", "needs a cluster", check_helm),
    Allowed("kind", "needs a Docker daemon", check_kind),
    Allowed("sudo apt install", "changes the machine", check_apt),
    Allowed("apt install", "changes the machine", check_apt),
    Allowed("pip install", "uses the network", check_paths),
    Allowed("grpcurl", "not packaged by Debian", check_grpcurl),
    Allowed("systemctl", "needs systemd", check_unit),
]


def allowed(words):
    """Returns the entry for a command, or None."""
    return next((entry for entry in ALLOWED if entry.matches(words)), None)


def faults(words):
    """Returns what is wrong with a command, as far as that can be seen without
    running it."""
    entry = allowed(words)
    if entry:
        return entry.check(words)
    if words[0] in ("isomatch", "isomatch-server"):
        return programs.check_program(words)
    return programs.check_script(words)
