#!/usr/bin/env python3
"""Fails when a reason of server/jobs/errors.cc is not in the table of
proto/README.md, or in no test.

    check_reasons.py ROOT
"""
import pathlib
import re
import sys


def reasons_in(text):
    return set(re.findall(r'"([A-Z_]{4,})"', text)) - {"SUCCEEDED"}  # a state


def main(root):
    root = pathlib.Path(root)
    reasons = reasons_in((root / "server/jobs/errors.cc").read_text())
    assert "QUEUE_FULL" in reasons  # the pattern finds them
    manual = (root / "proto/README.md").read_text()
    tests = "".join(path.read_text()
                    for path in (root / "tests").rglob("*_test.cc"))
    problems = [f"{reason} is not in proto/README.md" for reason in reasons
                if f"`{reason}`" not in manual]
    problems += [f"{reason} is in no test" for reason in reasons
                 if f'"{reason}"' not in tests]
    print("\n".join(sorted(problems)) or f"{len(reasons)} reasons are documented"
          " and tested")
    return 1 if problems else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
