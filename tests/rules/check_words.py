#!/usr/bin/env python3
"""Fails when a file has a British spelling: the product's is American.

    check_words.py ROOT

CANCELLED is gRPC's word, and so ours. Files of others are not looked at.
"""
import pathlib
import re
import sys

BRITISH = re.compile(
    r"colour|neighbour|behaviour|favour|honour|centre|centring|grey(?!hound)|judgement"
    r"|licence|modelled|labelled|labelling|travelled|signalled|afterwards|towards"
    r"|(normal|factor|serial|raster|synchron|quant|summar|regular|minim|maxim|discret"
    r"|vector|recogn|initial|organ|parametr|visual|general|optim)is(e|es|ed|er|ers|ing"
    r"|ation|ations|able)\b", re.I)

FOLDERS = ("client", "core", "docker", "proto", "scripts", "server", "tests")
TEXT = {".cc", ".h", ".py", ".js", ".mjs", ".md", ".proto", ".txt", ".html", ".css",
        ".json", ".yaml", ".toml", ".conf", ".cmake", ".in", ".service", ""}
SKIPPED = {"node_modules", "corpus", "data", "package-lock.json", "check_words.py",
           "__pycache__", "LICENSE"}


def problems_of(name, text):
    for number, line in enumerate(text.splitlines(), 1):
        for found in BRITISH.finditer(line):
            yield f"{name}:{number}: '{found.group(0)}' is British, expected American spelling"


def files_of(root):
    for path in sorted(root.iterdir()):
        if path.is_file():
            yield path
    for folder in FOLDERS:
        yield from sorted((root / folder).rglob("*"))


def main(root):
    root = pathlib.Path(root)
    found, count = [], 0
    for path in files_of(root):
        name = path.relative_to(root)
        if not path.is_file() or path.suffix not in TEXT or SKIPPED & set(name.parts):
            continue
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue
        count += 1
        found += problems_of(name, text)
    print("\n".join(found) or f"{count} files have American spelling")
    # The words must be able to say no, and not to what is no British word.
    assert list(problems_of("x.md", "Normalised by the Centre's colour."))
    assert not list(problems_of("x.md", "optimistic characteristics, CANCELLED"))
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
