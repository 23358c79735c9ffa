"""What readme_commands_test.py finds in a document, and which faults it sees."""

import unittest

import programs
import readme
from allowed import faults
from readme_commands_test import is_run

PAGE = """# Page

Text with `isomatch match X Y
-o MAP` and `a\\|b`.

    isomatch hidden

## Section

```sh
isomatch match X Y \\
  -o MAP    # a comment
# another

(umask 077; openssl version) && isomatch man
```

```python
import isomatch  # `not a span`
```
"""

# A command, and what is said of it.
FAULTS = {
    "isomatch match X Y --none": "isomatch match knows no --none",
    "isomatch none X": "isomatch has no command none",
    "isomatch --none": "isomatch knows no --none",
    "isomatch-server --none": "isomatch-server knows no --none",
    "scripts/none": "no program of this repository",
    "scripts/demo --none": "scripts/demo knows no --none",
    "scripts/test --preset none": "no none among the testPresets",
    "scripts/bench none": "scripts/bench has no command none",
    "scripts/bench fetch-sets SNAPSHOTS OUT none": "fetch-sets knows no set none",
    "scripts/bench fetch-sets SNAPSHOTS OUT --none": "scripts/bench knows no --none",
    "scripts/bench speed --none": "scripts/bench speed knows no --none",
    "cmake --preset none": "no none among the configurePresets",
    "cmake --build --preset soak": "no soak among the buildPresets",
    "cmake --install build/release --component none": "no component none",
    "cmake --build --preset dev --target none": "no target none",
    "server_binary_test --gtest_filter='NoneTest.*'": "no suite NoneTest",
    "ctest --preset none": "no none among the testPresets",
    "ctest -L none": "no test has the label none",
    "docker compose -f docker/none.yaml up": "no docker/none.yaml",
    "docker run --none isomatch-server --health": "no docker run --none",
    "docker run --rm none": "makes no image none",
    "docker run --rm isomatch match X Y --none": "isomatch match knows no --none",
    "docker run -e ISOMATCH_NONE=1 isomatch-server": "no ISOMATCH_NONE",
    "docker run -v a:/data -p 7443:7443 isomatch-server": "without TLS",
    "docker run -p 7443:7443 -e ISOMATCH_INSECURE=1 isomatch-server": "mounts no /data",
    "docker run -v a:/data -p 7443:7 -e ISOMATCH_INSECURE=1 isomatch-server": "-p opens",
    "kubectl apply -f docker/kubernetes/none.yaml": "no docker/kubernetes/none.yaml",
    "kubectl -n isomatch create secret generic isomatch-none": "names no isomatch-none",
    "grpcurl -none 127.0.0.1:7443 list": "no grpcurl -none",
    "grpcurl 127.0.0.1:7443 describe isomatch.v1.None": "service.proto has no None",
    "grpcurl -d @ 127.0.0.1:7443 isomatch.v1.CorrespondenceService/None": "has no Corr",
    "sudo apt install ./build/package/none_*.deb": "none_*.deb is neither",
    "pip install ./client/none": "no client/none",
    "systemctl status none": "no unit none",
}


class RulesTest(unittest.TestCase):
    def test_blocks_know_where_they_are(self):
        shell, python = readme.blocks("page.md", PAGE)
        self.assertEqual((shell.section, shell.language, shell.line), ("Section", "sh", 10))
        self.assertEqual((python.language, str(python)), ("python", "page.md:18"))

    def test_lines_are_joined_and_lose_their_comments(self):
        [shell, _] = readme.blocks("page.md", PAGE)
        self.assertEqual(
            readme.lines(shell.text),
            ["isomatch match X Y -o MAP", "(umask 077; openssl version) && isomatch man"],
        )

    def test_a_line_has_one_or_more_simple_commands(self):
        self.assertEqual(
            readme.simple_commands('(umask 077; openssl -subj "/CN=a b") && isomatch man > m &'),
            [["umask", "077"], ["openssl", "-subj", "/CN=a b"], ["isomatch", "man", ">", "m"]],
        )

    def test_code_in_the_text_is_found_outside_blocks(self):
        self.assertEqual(
            [span.text for span in readme.spans("page.md", PAGE)],
            ["isomatch match X Y -o MAP", "a|b"],
        )
        self.assertEqual(readme.indented_lines(PAGE), ["isomatch hidden"])

    def test_flags_of_a_help_text(self):
        known = programs.known_flags(programs.CLIENT, "match")
        self.assertLessEqual({"-o", "--output", "--tls-ca"}, known)
        self.assertTrue(all(flag.startswith("-") and flag != "-" for flag in known), known)

    def test_what_is_neither_run_nor_allowed_is_refused(self):
        for line in ("curl http://127.0.0.1", "isomatch man | less", "isomatch man && ctest"):
            with self.subTest(line=line), self.assertRaises(AssertionError):
                is_run(line)
        self.assertTrue(is_run("isomatch man"))
        self.assertFalse(is_run("ctest"))

    def test_faults_are_seen(self):
        for command, expected in FAULTS.items():
            with self.subTest(command=command):
                self.assertIn(expected, "\n".join(faults(command.split())))


if __name__ == "__main__":
    unittest.main()
