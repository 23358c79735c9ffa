#!/usr/bin/env python3
"""Fails when OBJECT does more before main than to set up the streams of
<iostream>, or does it by instructions of AVX: nothing has found out yet whether
the processor knows them.

    check_startup.py OBJECT

OBJECT is core-x86-64-v3.o, whose .text has to use them: or the test sees nothing.
"""
import re
import subprocess
import sys

AVX = re.compile(r"\t(v(?!err|erw)[a-z]\w+)")
USES = re.compile(r": R_X86_64_\w+\t([\w.]+)")
OF_STREAMS = re.compile(r"\.bss|__dso_handle|__cxa_atexit|_ZNSt8ios_base4InitC1Ev"
                        r"|_ZNSt8ios_base4InitD1Ev")


def disassembled(path, section):
    return subprocess.run(
        ["objdump", "--no-show-raw-insn", "-dr", "-j", section, path],
        check=True, capture_output=True, text=True).stdout


def main(path):
    assert AVX.search(disassembled(path, ".text")), "no AVX in .text"
    startup = disassembled(path, ".text.startup")
    uses = USES.findall(startup)
    assert uses, "no <iostream> any more? Then nothing may be in .text.startup"
    problems = {f"{found} runs before main" for found in AVX.findall(startup)}
    problems |= {f"{use} is used before main" for use in uses
                 if not OF_STREAMS.fullmatch(use)}
    print("\n".join(sorted(problems)) or "only streams are set up before main")
    return 1 if problems else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
