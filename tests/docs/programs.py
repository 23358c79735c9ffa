"""The project's programs and scripts: which commands and flags they know."""

import functools
import itertools
import json
import os
import pathlib
import re
import subprocess

from readme import ROOT, flags

CLIENT = pathlib.Path(os.environ.get("ISOMATCH_BINARY", ""))
SERVER = pathlib.Path(os.environ.get("ISOMATCH_SERVER_BINARY", ""))
BENCH = pathlib.Path(os.environ.get("ISOMATCH_BENCH_BINARY", ""))


def environment(home):
    """Returns this process's environment, without its settings of Isomatch, with
    our programs in PATH and everything that is kept for a user below `home`."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("ISOMATCH")}
    path = os.pathsep.join([str(CLIENT.parent), str(SERVER.parent), clean["PATH"]])
    return {**clean, "PATH": path, "HOME": str(home), "XDG_STATE_HOME": str(home),
            "ISOMATCH_METRICS_LISTEN": "off"}  # fmt: skip


@functools.cache
def help_text(binary, *command):
    answer = subprocess.run(
        [binary, *command, "--help"], capture_output=True, text=True, timeout=60, check=True
    )
    return answer.stdout


@functools.cache
def known_flags(binary, *command):
    """Returns the flags at the beginnings of the lines of a program's --help."""
    starts = re.findall(r"^  (-\S.*?)(?:  | [A-Z[]|$)", help_text(binary, *command), re.MULTILINE)
    return {flag.split("=")[0] for start in starts for flag in re.split(r"[, ]+", start)}


@functools.cache
def subcommands(binary):
    listed = help_text(binary).split("Subcommands:\n")[1].split("\n\n")[0]
    return set(re.findall(r"^  (\w+)", listed, re.MULTILINE))


def usage(script):
    """Returns the comment at the head of one of our scripts."""
    lines = (ROOT / script).read_text().splitlines()
    return "\n".join(itertools.takewhile(lambda line: line.startswith("#"), lines))


def unknown_flags(words, known, where):
    return [f"{where} knows no {flag}" for flag in flags(words) if flag not in known]


def check_program(words):
    """Returns what is wrong with a call of isomatch or isomatch-server, as a list
    of sentences: subcommands and flags that --help does not name."""
    if words[0] == "isomatch-server":
        return unknown_flags(words, known_flags(SERVER), "isomatch-server")
    if len(words) == 1 or words[1].startswith("-"):
        return unknown_flags(words, known_flags(CLIENT), "isomatch")
    if words[1] == "COMMAND":
        return []
    if words[1] not in subcommands(CLIENT):
        return [f"isomatch has no command {words[1]}"]
    return unknown_flags(words, known_flags(CLIENT, words[1]), f"isomatch {words[1]}")


def check_bench(words):
    """As check_program(), of scripts/bench."""
    problems = check_script(words[:1])
    if len(words) > 1 and words[1] not in subcommands(BENCH):
        return [*problems, f"scripts/bench has no command {words[1]}"]
    return problems + unknown_flags(words, known_flags(BENCH, *words[1:2]), " ".join(words[:2]))


def check_script(words):
    """As check_program(), of a script whose head says what it takes."""
    script = ROOT / words[0]
    if not (script.is_file() and os.access(script, os.X_OK)):
        return [f"{words[0]} is no program of this repository"]
    known = set(re.findall(r"--[a-z-]+", usage(words[0])))
    return unknown_flags(words, known, words[0]) + check_presets(words)


def check_presets(words):
    """As check_program(): --preset names a preset."""
    presets = json.loads((ROOT / "CMakePresets.json").read_text())
    kind = {"ctest": "testPresets", "cmake": "configurePresets"}.get(words[0], "testPresets")
    if "--build" in words:
        kind = "buildPresets"
    names = {preset["name"] for preset in presets[kind] if not preset.get("hidden")}
    given = [value for flag, value in zip(words, words[1:]) if flag == "--preset"]
    return [f"CMakePresets.json has no {name} among the {kind}"
            for name in given if name not in names]  # fmt: skip


def every_flag():
    """Returns the flags of all our programs and scripts."""
    known = {"--help", "--version"} | known_flags(SERVER)
    for binary in (CLIENT, BENCH):
        for name in subcommands(binary):
            known |= known_flags(binary, name)
    for folder in ("scripts", "docker", "docker/debian"):
        for script in (ROOT / folder).iterdir():
            if script.is_file() and os.access(script, os.X_OK):
                known |= set(re.findall(r"--[a-z-]+", usage(f"{folder}/{script.name}")))
    return known
