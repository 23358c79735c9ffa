"""Every command of our Markdown, run as it stands there in a scratch folder with
what it reads, and a real server where it wants one. What cannot be run in a test is
in allowed.py, with the reason, and is looked at without being run."""

import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

import programs
import readme
from allowed import ALLOWED, allowed, faults
from readme import ROOT

# Programs that commands of the manuals may run here: they stay in the scratch folder.
RUNNABLE = {"isomatch", "isomatch-server", "openssl", "umask"}

# Blocks that other tests run as they stand: how many of a language in a section.
ELSEWHERE = {
    ("README.md", "From other languages", "python"): (1, "tests/languages/python/readme_test.py"),
    ("client/README.md", "Python", "python"): (2, "tests/languages/python/readme_test.py"),
    ("client/README.md", "Node", "sh"): (1, "tests/languages/python/readme_test.py"),
    ("client/README.md", "C++", "cmake"): (1, "tests/languages/python/cpp_test.py"),
    ("client/README.md", "C++", "cpp"): (1, "tests/languages/python/cpp_test.py"),
    ("proto/README.md", "Numbering", "cpp"): (1, "tests/languages/python/numbering_test.py"),
    ("proto/README.md", "Numbering", "js"): (1, "tests/languages/python/numbering_test.py"),
    ("proto/README.md", "From a shell", "sh"): (3, "tests/languages/python/buf_test.py"),
    ("proto/README.md", "In other languages", "sh"): (1, "tests/languages/python/generated_code_test.py"),
    ("server/README.md", "Several machines", "sh"): (1, "tests/docs/cluster_pages_test.py"),
    ("server/README.md", "Running it", "sh"): (2, "tests/docs/cluster_pages_test.py"),
}

# Flags that the text names by themselves and that are other programs'.
FOREIGN_FLAGS = {
    "--cacert": "buf curl",
    "--header": "buf curl",
    "--http2-prior-knowledge": "buf curl",
}

# Where the manuals' server listens, or is called. All become one free port.
ADDRESSES = {
    "127.0.0.1:7443": "127.0.0.1",
    "0.0.0.0:7443": "0.0.0.0",
    "meshes.example.org:7443": "127.0.0.1",
}

# Flags of isomatch with a file or folder that is to be written.
WRITTEN = ("-o", "--report", "--precise", "--confidence", "--png")

TEXTS = {name: (ROOT / name).read_text() for name in readme.documents()}
BLOCKS = [block for name, text in TEXTS.items() for block in readme.blocks(name, text)]


def is_elsewhere(block):
    return (block.document, block.section, block.language) in ELSEWHERE


def shell_blocks():
    return [block for block in BLOCKS if block.language == "sh" and not is_elsewhere(block)]


def is_run(line):
    """Whether a command is run here. Fails when it is neither run nor allowed."""
    simple = readme.simple_commands(line)
    unclear = [" ".join(words) for words in simple
               if words[0] not in RUNNABLE and not allowed(words)]  # fmt: skip
    if unclear:
        raise AssertionError(f"neither run by this test nor in allowed.py: {unclear}")
    runs = {words[0] in RUNNABLE for words in simple}
    assert len(runs) == 1, f"a line for what is run, another for what is not: {line}"
    return runs.pop()


def commands_in_text():
    """Returns (where, words) of the calls of our programs, and of those that are
    allowed, between backticks. client/README.md leaves `isomatch` out at times."""
    found = []
    names = programs.subcommands(programs.CLIENT)
    for document, text in TEXTS.items():
        for span in readme.spans(document, text):
            words = span.text.split()
            if document == "client/README.md" and len(words) > 1 and words[0] in names:
                words.insert(0, "isomatch")
            ours = words[0] in ("isomatch", "isomatch-server") or words[0].startswith("scripts/")
            if ours or allowed(words):
                found.append((span, words))
    return found


def free_port(offsets=(0,)):
    """Returns a port that is free, as are those so far above it; all are below those
    that the kernel gives to others who ask for any."""
    for port in random.sample(range(20000, 30000), 100):
        if all(is_free(port + offset) for offset in offsets):
            return port
    raise RuntimeError("no free port between 20000 and 30000")


def is_free(port):
    with socket.socket() as probe:
        try:
            probe.bind(("0.0.0.0", port))
        except OSError:
            return False
    return True


def script(block):
    """Returns the commands of a block that are run, as a script for bash that ends
    the servers which it starts; empty when there are none."""
    commands = [line for line in readme.lines(block.text) if is_run(line)]
    if not commands:
        return ""
    if any("--server" in line for line in commands) and not any(map(starts_server, commands)):
        commands.insert(0, "isomatch-server --ephemeral --listen 127.0.0.1:7443")
    port = free_port()
    steps = ["set -euo pipefail", "trap 'kill $(jobs -p) 2>/dev/null || true; wait' EXIT"]
    for line in commands:
        for address, host in ADDRESSES.items():
            line = line.replace(address, f"{host}:{port}")
        steps.append(line)
        if starts_server(line):
            steps[-1] = line.removesuffix("&") + " &"
            if not line.endswith("&"):  # a terminal of its own, where one sees it listen
                steps.append(f"until (: < /dev/tcp/127.0.0.1/{port}) 2>/dev/null")
                steps.append("do kill -0 $!; sleep 0.05; done")
    return "\n".join(steps) + "\n"


def starts_server(line):
    return re.match(r"isomatch-server .*--listen ", line)


def written(text):
    """Returns the names of what the isomatch commands of a script write."""
    found = []
    for line in text.splitlines():
        for words in readme.simple_commands(line):
            if words[0] == "isomatch":
                found += [value for flag, value in zip(words, words[1:]) if flag in WRITTEN]
    return found


def make_inputs(folder):
    """Writes what the commands of the manuals read, as small as can be."""
    for name, pose in (("cat.off", "A"), ("dog.off", "B")):
        arguments = ["sample", "--pose", pose, "--vertices", "500", "-o", folder / name]
        if pose == "B":
            arguments += ["--truth-from", "A:500", "--truth", folder / "truth.txt"]
        subprocess.run([programs.CLIENT, *arguments], check=True, timeout=60)
    for name, options in (("dog.obj", ["--pose", "B", "--texture", "checker"]),
                          ("scan.ply", ["--pose", "C"])):  # fmt: skip
        arguments = ["sample", *options, "--vertices", "500", "-o", folder / name]
        subprocess.run([programs.CLIENT, *arguments], check=True, timeout=60)
    for copy, original in (("X.off", "cat.off"), ("Y.off", "dog.off"), ("template.off", "cat.off")):
        shutil.copy(folder / original, folder / copy)
    (folder / "scans").mkdir()
    shutil.copy(folder / "dog.off", folder / "scans/one.off")
    (folder / "pairs.txt").write_text("cat dog\n")


def run_script(text, folder):
    """Returns (exit status, what was said) of a script for bash."""
    process = subprocess.Popen(
        ["bash", "-c", text], cwd=folder, env=programs.environment(folder / "home"),
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    )  # fmt: skip
    try:
        said, _ = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        said, _ = process.communicate()
        said += "\nnot done after 60 s"
    return process.returncode, said


class CommandsTest(unittest.TestCase):
    def test_every_block_has_a_language_whose_commands_are_tested(self):
        for block in BLOCKS:
            with self.subTest(block=str(block)):
                self.assertTrue(
                    block.language == "sh" or is_elsewhere(block),
                    f"```{block.language}: expected sh, or an entry in ELSEWHERE",
                )

    def test_no_command_hides_in_an_indented_block(self):
        for document, text in TEXTS.items():
            for line in readme.indented_lines(text):
                words = line.split()
                is_command = words[:1] and (words[0] in RUNNABLE or allowed(words))
                self.assertFalse(is_command, f"{document}: {line}: expected a block ```sh")

    def test_other_tests_run_the_rest(self):
        for key, (count, test) in ELSEWHERE.items():
            document, section, language = key
            here = [block for block in BLOCKS
                    if (block.document, block.section, block.language) == key]  # fmt: skip
            self.assertEqual(len(here), count, f"{document}, {section}: blocks ```{language}")
            text = (ROOT / test).read_text()
            self.assertIn(f'"{section}", "{language}"', text, f"{test} does not run them")

    def test_what_is_not_run_is_looked_at(self):
        for block in shell_blocks():
            for line in readme.lines(block.text):
                with self.subTest(block=str(block), command=line):
                    if not is_run(line):
                        for words in readme.simple_commands(line):
                            self.assertEqual(faults(words), [])

    def test_commands_in_the_text_have_flags_that_are_known(self):
        for span, words in commands_in_text():
            with self.subTest(where=str(span)):
                self.assertEqual(faults(words), [])

    def test_files_in_the_text_exist(self):
        for document, text in TEXTS.items():
            for span in readme.spans(document, text):
                if re.fullmatch(rf"({'|'.join(readme.FOLDERS)})/[\w./-]+", span.text):
                    with self.subTest(where=str(span)):
                        # Often without the extension, for a header and its source.
                        self.assertTrue(
                            (ROOT / span.text).exists() or [*ROOT.glob(span.text + ".*")]
                        )

    def test_flags_in_the_text_are_known(self):
        known = programs.every_flag() | set(FOREIGN_FLAGS)
        spans = [span for name, text in TEXTS.items() for span in readme.spans(name, text)]
        named = {flag for span in spans if span.text.startswith("--")
                 for flag in readme.flags(span.text.split())}  # fmt: skip
        self.assertEqual(sorted(named - known), [])
        self.assertEqual(sorted(set(FOREIGN_FLAGS) - named), [], "no longer in any document")

    def test_everything_that_is_allowed_is_there(self):
        calls = [words for _, words in commands_in_text()]
        for block in shell_blocks():
            for line in readme.lines(block.text):
                calls += readme.simple_commands(line)
        used = [allowed(words) for words in calls]
        self.assertEqual([entry.start for entry in ALLOWED if entry not in used], [])

    def test_every_block_runs(self):
        with tempfile.TemporaryDirectory(prefix="isomatch-docs-") as scratch:
            inputs = pathlib.Path(scratch) / "inputs"
            inputs.mkdir()
            make_inputs(inputs)
            for number, block in enumerate(shell_blocks()):
                folder = shutil.copytree(inputs, pathlib.Path(scratch) / str(number))
                with self.subTest(block=str(block)):
                    text = script(block)
                    status, said = run_script(text, folder)
                    self.assertEqual(status, 0, f"{text}\n{said}")
                    for name in written(text):
                        path = folder / name
                        there = any(path.iterdir()) if path.is_dir() else path.stat().st_size
                        self.assertTrue(there, f"{name} is empty")


if __name__ == "__main__":
    if not (programs.CLIENT.is_file() and programs.SERVER.is_file() and programs.BENCH.is_file()):
        sys.exit(
            "set ISOMATCH_BINARY, ISOMATCH_SERVER_BINARY and ISOMATCH_BENCH_BINARY, as ctest does"
        )
    unittest.main()
