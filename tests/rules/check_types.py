"""Checks that no two headers define a type of one name or declare one function.

    check_types.py ROOT

All of ours are in one namespace, and one program may hold server and client: of
two classes of one name the linker takes either's destructor for both, of two
functions either.
"""

import collections
import pathlib
import re
import sys

TYPE = re.compile(r"^(?:struct|class|enum class)\s+(?:ABSL_\w+\s+)?(\w+)\s*(?:final\s*)?[:{]", re.M)
FUNCTION = re.compile(r"^\w[\w:<>,*& ]*?[ *&](\w+\([^;{}]*\));", re.M)


def doubles(texts):
    """Yields what is wrong in headers, a dict of their texts by name."""
    headers = collections.defaultdict(list)
    for name, text in texts.items():
        for found in TYPE.finditer(text):
            if not text[found.end() - 1:].startswith("::"):
                headers[found.group(1)].append(name)
        for found in FUNCTION.finditer(text):
            headers[" ".join(found.group(1).split())].append(name)
    for what, names in headers.items():
        if len(names) > 1:
            yield f"{what} is in {', '.join(names)}: expected one of them"


def main(root):
    root = pathlib.Path(root)
    texts = {str(p.relative_to(root)): p.read_text()
             for top in ("core", "server", "client", "tests")
             for p in sorted((root / top).rglob("*.h")) if "node_modules" not in p.parts}
    found = list(doubles(texts))
    print("\n".join(found) or f"{len(texts)} headers have each type and function once")
    # It must be able to say no.
    assert list(doubles({"a.h": "struct A {\n};\n", "b.h": "class A : public B {\n"}))
    assert not list(doubles({"a.h": "class A {\n", "b.h": "struct A::Part {\nclass A;\n"}))
    assert list(doubles({"a.h": "int F(int n);\n", "b.h": "long F(int n);\n"}))
    assert not list(doubles({"a.h": "int F(int n);\n", "b.h": "  int F(int n);\nint F();\n"}))
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
