"""Reads our Markdown: its code blocks, their commands, and code in the text."""

import dataclasses
import pathlib
import re
import shlex

ROOT = pathlib.Path(__file__).resolve().parents[2]

# Ours; build/ is made.
FOLDERS = ("client", "core", "docker", "proto", "scripts", "server", "tests")

# What separates simple commands in a line of shell.
SEPARATORS = {"&&", "||", "|", ";", "&", "(", ")", ");"}


@dataclasses.dataclass(frozen=True)
class Block:
    """A fenced block of code."""

    document: str  # path from ROOT
    section: str  # the heading above it
    line: int  # of the fence, counted from 1
    language: str
    text: str

    def __str__(self):
        return f"{self.document}:{self.line}"


@dataclasses.dataclass(frozen=True)
class Span:
    """Code between backticks within the text, on one line."""

    document: str
    text: str

    def __str__(self):
        return f"{self.document}: `{self.text}`"


def documents():
    """Returns the paths of our Markdown files from ROOT, but of CHANGELOG.md,
    which may name what is gone."""
    found = [*ROOT.glob("*.md")]
    for folder in FOLDERS:
        found += (ROOT / folder).rglob("*.md")
    names = [path.relative_to(ROOT) for path in sorted(found)]
    return [str(name) for name in names
            if "node_modules" not in name.parts and name.name != "CHANGELOG.md"]  # fmt: skip


def blocks(document, text):
    """Returns the fenced blocks of a Markdown text."""
    found, section, opened = [], "", None
    for number, line in enumerate(text.splitlines(), start=1):
        fence = re.match(r"\s*```\s*(\S*)", line)
        if fence and opened is None:
            opened, language, content = number, fence.group(1), []
        elif fence:
            body = "".join(f"{line}\n" for line in content)
            found.append(Block(document, section, opened, language, body))
            opened = None
        elif opened is not None:
            content.append(line)
        elif line.startswith("#"):
            section = line.lstrip("#").strip()
    assert opened is None, f"{document}:{opened}: a block that does not end"
    return found


def prose(text):
    """Returns a Markdown text without its fenced blocks."""
    return re.sub(r"^\s*```.*?^\s*```$", "", text, flags=re.DOTALL | re.MULTILINE)


def spans(document, text):
    """Returns what stands between single backticks outside fenced blocks."""
    found = re.findall(r"(?<!`)`([^`]+)`(?!`)", prose(text))
    # In tables | is written \|.
    return [Span(document, " ".join(span.split()).replace("\\|", "|")) for span in found]


def indented_lines(text):
    """Returns the lines of indented blocks, which have no language."""
    return [line.strip() for line in prose(text).splitlines() if line.startswith("    ")]


def lines(script):
    """Returns the commands of a shell script that has one a line, continued lines
    joined, without comments and empty lines."""
    joined = re.sub(r"\\\n\s*", "", script)
    stripped = (re.sub(r"(^|\s)#.*", "", line).strip() for line in joined.splitlines())
    return [line for line in stripped if line]


def simple_commands(line):
    """Returns the words of each simple command of a line of shell, redirections
    among them."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    commands = [[]]
    for word in lexer:
        if word in SEPARATORS:
            commands.append([])
        else:
            commands[-1].append(word)
    return [words for words in commands if words]


def flags(words):
    """Returns the flags among the words of a command, without their values."""
    return [word.split("=")[0] for word in words if re.match(r"-[A-Za-z]$|--[a-z]", word)]
