#!/usr/bin/env python3
"""Fails when a function or a file is longer than CONTRIBUTING.md allows.

    check_sizes.py ROOT

Functions: at most 60 lines, and 95 % of them at most 40, counted from their first
line to their last brace. Files: at most 500 lines.
"""
import pathlib
import re
import sys

MOST_LINES = 60
MOST_LINES_OF_95_PERCENT = 40
MOST_LINES_OF_A_FILE = 500

SKIPPED = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|'
                     r"(?<![\w])'(?:\\.|[^'\\\n])+'|^[ \t]*#(?:[^\n\\]|\\\n|\\.)*",
                     re.S | re.M)
CONTAINER = re.compile(r"^\s*(?:template\s*<.*>\s*)?(?:inline\s+)?"
                       r"(?:namespace|class|struct|union|enum|extern)\b", re.S)


def blank(found):
    return re.sub(r"[^\n]", " ", found.group(0))


def functions_of(text):
    """Yields first line, last line and name of each function with a body."""
    code = SKIPPED.sub(blank, text)
    open_braces = []  # of each: (is it a container, start of its text)
    start = 0  # of what the next brace belongs to
    for at, sign in ((m.start(), m.group(0)) for m in re.finditer(r"[{};]", code)):
        in_container = all(is_container for is_container, _ in open_braces)
        if sign == "{":
            head = code[start:at]
            is_container = in_container and bool(CONTAINER.match(head))
            is_function = in_container and not is_container and "(" in head
            # Macros may come before, after which no semicolon stands.
            blanks = [m.end() for m in re.finditer(r"\n[ \t]*(?=\n)", head)]
            begin = start + (blanks[-1] if blanks else 0)
            open_braces.append((is_container, begin if is_function else None))
            if in_container:
                start = at + 1
        elif sign == "}" and open_braces:
            is_container, begin = open_braces.pop()
            if begin is not None:
                head = code[begin:at]
                begin += len(head) - len(head.lstrip())
                name = re.search(r"([\w:~]+|operator\S+)\s*\(", code[begin:])
                yield (text.count("\n", 0, begin) + 1, text.count("\n", 0, at) + 1,
                       name.group(1) if name else "?")
            if all(is_container for is_container, _ in open_braces):
                start = at + 1
        elif sign == ";" and in_container:
            start = at + 1


def problems_of(name, text, lengths):
    lines = text.count("\n")
    if lines > MOST_LINES_OF_A_FILE:
        yield f"{name}: {lines} lines, expected at most {MOST_LINES_OF_A_FILE}"
    for first, last, function in functions_of(text):
        length = last - first + 1
        lengths.append(length)
        if length > MOST_LINES:
            yield (f"{name}:{first}: {function} has {length} lines, "
                   f"expected at most {MOST_LINES}")


def of_95_percent(lengths):
    return sorted(lengths)[int(0.95 * (len(lengths) - 1))]


def planted(lines):
    """A function of so many lines."""
    return "int Sum(int n) {\n" + "  ++n;\n" * (lines - 2) + "}\n"


def check_itself():
    assert not list(problems_of("a.cc", planted(MOST_LINES), []))
    assert list(problems_of("a.cc", planted(MOST_LINES + 1), []))
    inner = "namespace a {\nclass B {\n void C() const {\n" + "x;\n" * 60 + "}\n};\n}\n"
    assert list(problems_of("a.cc", inner, []))
    assert list(problems_of("a.h", "\n" * (MOST_LINES_OF_A_FILE + 1), []))
    lengths = []
    assert not list(problems_of("a.cc", planted(4) * 3 + planted(50) * 2, lengths))
    assert lengths == [4, 4, 4, 50, 50]
    assert of_95_percent(lengths) > MOST_LINES_OF_95_PERCENT


def main(root):
    check_itself()
    root = pathlib.Path(root)
    files = sorted(p for top in ("core", "server", "client")
                   for p in (root / top).rglob("*")
                   if p.suffix in (".h", ".cc") and "node_modules" not in p.parts)
    lengths = []
    found = [problem for p in files
             for problem in problems_of(str(p.relative_to(root)), p.read_text(), lengths)]
    longest = of_95_percent(lengths)
    if longest > MOST_LINES_OF_95_PERCENT:
        found.append(f"95 % of the functions have up to {longest} lines, expected at most "
                     f"{MOST_LINES_OF_95_PERCENT}")
    print("\n".join(found) or
          f"{len(lengths)} functions in {len(files)} files: at most {max(lengths)} lines, "
          f"95 % at most {longest}")
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
