#!/usr/bin/env python3
"""Fails when a function, a file or a class is larger than CONTRIBUTING.md allows.

    check_sizes.py ROOT

Functions: at most 60 lines, and 95 % of them at most 40, counted from their first
line to their last brace; at most five parameters. Files: at most 500 lines. A class
whose members are in several .cc files: at most 500 lines in all of them, so that
nobody cuts a large class into files instead of classes.
"""
import collections
import pathlib
import re
import sys

MOST_LINES = 60
MOST_LINES_OF_95_PERCENT = 40
MOST_LINES_OF_A_FILE = 500
MOST_PARAMETERS = 5

# Folder -> functions that may have more parameters. To be emptied: one that has
# become smaller, or is gone, fails until it is taken out of here.
TOLERATED_PARAMETERS = {}

# Classes in several files of more lines together, which want to be several classes.
TOLERATED_CLASSES = set()

SKIPPED = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|'
                     r"(?<![\w])'(?:\\.|[^'\\\n])+'|^[ \t]*#(?:[^\n\\]|\\\n|\\.)*",
                     re.S | re.M)
CONTAINER = re.compile(r"^\s*(?:template\s*<.*>\s*)?(?:inline\s+)?"
                       r"(?:namespace|class|struct|union|enum|extern)\b", re.S)


def blank(found):
    return re.sub(r"[^\n]", " ", found.group(0))


Function = collections.namedtuple("Function", "first last name parameters")


def count_parameters(code):
    """Counts the parameters of the list that `code` begins with, at its parenthesis."""
    depth, commas = 0, 0
    for at, sign in enumerate(code):
        depth += sign in "([{<"
        depth -= sign in ")]}" or (sign == ">" and code[at - 1] != "-")
        commas += sign == "," and depth == 1
        if depth == 0:
            return commas + 1 if code[1:at].strip() else 0
    return 0


def functions_of(text):
    """Yields each function with a body: a Function, with its first and last line."""
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
                name = re.search(r"([\w:~]+|operator\S+)\s*(?=\()", code[begin:])
                yield Function(text.count("\n", 0, begin) + 1, text.count("\n", 0, at) + 1,
                               name.group(1) if name else "?",
                               count_parameters(code[begin + name.end():at]) if name else 0)
            if all(is_container for is_container, _ in open_braces):
                start = at + 1
        elif sign == ";" and in_container:
            start = at + 1


def problems_of(name, text, lengths):
    lines = text.count("\n")
    if lines > MOST_LINES_OF_A_FILE:
        yield f"{name}: {lines} lines, expected at most {MOST_LINES_OF_A_FILE}"
    for function in functions_of(text):
        length = function.last - function.first + 1
        lengths.append(length)
        if length > MOST_LINES:
            yield (f"{name}:{function.first}: {function.name} has {length} lines, "
                   f"expected at most {MOST_LINES}")


def parameter_problems(texts, tolerated):
    """Yields what has too many parameters in files, a dict of their texts by name."""
    found = set()
    for name, text in texts.items():
        folder = name.rpartition("/")[0]
        for function in functions_of(text):
            if function.parameters <= MOST_PARAMETERS:
                continue
            found.add((folder, function.name))
            if function.name not in tolerated.get(folder, ()):
                yield (f"{name}:{function.first}: {function.name} has {function.parameters} "
                       f"parameters, expected at most {MOST_PARAMETERS}: a struct of those "
                       "that belong together")
    for folder, names in tolerated.items():
        for function in sorted(names):
            if (folder, function) not in found:
                yield (f"{folder}: {function} has at most {MOST_PARAMETERS} parameters, "
                       "expected that check_sizes.py does not tolerate it any more")


def class_problems(texts, tolerated):
    """Yields the classes that are too large for their several .cc files."""
    files = collections.defaultdict(set)
    for name, text in texts.items():
        if name.endswith(".cc"):
            for function in functions_of(text):
                if "::" in function.name:
                    files[function.name.partition("::")[0]].add(name)
    large = {}
    for of_class, names in files.items():
        lines = sum(texts[name].count("\n") for name in names)
        if len(names) > 1 and lines > MOST_LINES_OF_A_FILE:
            large[of_class] = (f"{of_class} has {lines} lines in {', '.join(sorted(names))}, "
                               f"expected one file, or at most {MOST_LINES_OF_A_FILE} lines")
    yield from (problem for name, problem in large.items() if name not in tolerated)
    for name in sorted(tolerated - large.keys()):
        yield (f"{name} is not too large for its files, expected that check_sizes.py does "
               "not tolerate it any more")


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
    check_parameters_itself()
    check_classes_itself()


def check_parameters_itself():
    most = "void A::F(int a, std::map<int, int> b, void (*c)(int, int), int d = G(1, 2), int e)"
    five = {"a/b.cc": most + " {\n}\n"}
    six = {"a/b.cc": most.replace("int a", "int a, int z") + " {\n}\n"}
    assert not list(parameter_problems(five, {}))
    assert list(parameter_problems(six, {}))
    assert list(parameter_problems(six, {"a/c": {"A::F"}}))
    assert not list(parameter_problems(six, {"a/b": {}, "a": {"A::F"}}))
    assert list(parameter_problems(five, {"a": {"A::F"}}))


def check_classes_itself():
    def files(first, second, lines):
        return {"a/b.cc": f"void {first}::F() {{\n}}\n", "a/b_more.cc":
                f"void {second}::G() {{\n}}\n" + "\n" * lines}
    assert not list(class_problems(files("A", "A", MOST_LINES_OF_A_FILE - 4), set()))
    assert list(class_problems(files("A", "A", MOST_LINES_OF_A_FILE - 3), set()))
    assert list(class_problems(files("A", "A::Inner", MOST_LINES_OF_A_FILE), set()))
    assert not list(class_problems(files("A", "B", MOST_LINES_OF_A_FILE), set()))
    assert not list(class_problems(files("A", "A", MOST_LINES_OF_A_FILE), {"A"}))
    assert list(class_problems(files("A", "A", 0), {"A"}))


def main(root):
    check_itself()
    root = pathlib.Path(root)
    files = sorted(p for top in ("core", "server", "client")
                   for p in (root / top).rglob("*")
                   if p.suffix in (".h", ".cc") and "node_modules" not in p.parts)
    texts = {str(p.relative_to(root)): p.read_text() for p in files}
    lengths = []
    found = [problem for name, text in texts.items()
             for problem in problems_of(name, text, lengths)]
    found += parameter_problems(texts, TOLERATED_PARAMETERS)
    found += class_problems(texts, TOLERATED_CLASSES)
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
