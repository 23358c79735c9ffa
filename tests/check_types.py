"""Checks that no two headers define a type of one name.

    check_types.py ROOT

All of ours are in one namespace, and one program may hold server and client: of
two classes of one name the linker takes either's destructor for both.
"""

import collections
import pathlib
import re
import sys

TYPE = re.compile(r"^(?:struct|class|enum class)\s+(?:ABSL_\w+\s+)?(\w+)\s*(?:final\s*)?[:{]", re.M)


def doubles(texts):
    """Yields what is wrong in headers, a dict of their texts by name."""
    headers = collections.defaultdict(list)
    for name, text in texts.items():
        for found in TYPE.finditer(text):
            if not text[found.end() - 1:].startswith("::"):
                headers[found.group(1)].append(name)
    for type_name, names in headers.items():
        if len(names) > 1:
            yield f"{type_name} is defined in {', '.join(names)}: expected one of them"


def main(root):
    root = pathlib.Path(root)
    texts = {str(p.relative_to(root)): p.read_text()
             for top in ("core", "server", "client")
             for p in sorted((root / top).rglob("*.h")) if "node_modules" not in p.parts}
    found = list(doubles(texts))
    print("\n".join(found) or f"{len(texts)} headers define each type once")
    # It must be able to say no.
    assert list(doubles({"a.h": "struct A {\n};\n", "b.h": "class A : public B {\n"}))
    assert not list(doubles({"a.h": "class A {\n", "b.h": "struct A::Part {\nclass A;\n"}))
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
