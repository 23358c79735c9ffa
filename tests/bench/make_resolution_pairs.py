#!/usr/bin/env python3
"""Makes a set of pairs of unlike resolution from the shared data, for
`isomatch-bench accuracy OUT`.

    make_resolution_pairs.py DATA_DIR OUT

1,000 and 3,000 vertices against 13,380, both ways, and 5,000 against 214,050.
The truth goes over the template: NAME.idx names the template vertex of each
vertex of a decimated mesh, the full meshes are numbered as the template, and
so are the first vertices of the subdivided ones.
"""
import pathlib
import struct
import sys

PAIRS = [
    ("r1k_m_rest", "full_m_kick"), ("r1k_m_sit", "full_m_rest"),
    ("r1k_f_walk", "full_f_reach"), ("r1k_m_sit", "full_f_reach"),
    ("r3k_m_sit_leftdense", "full_m_rest"),
    ("r3k_m_sit_leftdense", "full_f_reach"),
    ("r5k_m_walk", "mh200k_X"), ("r5k_m_sit", "mh200k_Y"),
]


def copy_off(path, out):
    out.write_bytes(path.read_bytes())


def ply_to_off(path, out):
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    words = data[:end].split()
    vertices = int(words[words.index(b"vertex") + 1])
    faces = int(words[words.index(b"face") + 1])
    coordinates = struct.unpack_from(f"<{3 * vertices}f", data, end)
    lines = ["OFF", f"{vertices} {faces} 0"]
    lines += ["%r %r %r" % coordinates[3 * v:3 * v + 3]
              for v in range(vertices)]
    offset = end + 12 * vertices
    for f in range(faces):
        count, a, b, c = struct.unpack_from("<Biii", data, offset + 13 * f)
        assert count == 3
        lines.append(f"3 {a} {b} {c}")
    out.write_text("\n".join(lines) + "\n")


def positions(path, count):
    lines = path.read_text().split("\n")
    return [tuple(map(float, line.split())) for line in lines[2:2 + count]]


def main(data, out):
    out.mkdir(parents=True, exist_ok=True)
    for name in sorted({name for pair in PAIRS for name in pair}):
        if name.startswith("mh"):
            ply_to_off(data / "large" / f"{name}.ply", out / f"{name}.off")
        else:
            copy_off(data / f"{name}.off", out / f"{name}.off")
    y_from_x = (data / "large" /
                "gt_mh200k_X__mh200k_Y.txt").read_text().split()
    for x, y in PAIRS:
        truth = (data / f"{x}.idx").read_text().split()
        if y == "mh200k_Y":
            truth = [y_from_x[int(t)] for t in truth]
        (out / f"gt_{x}__{y}.txt").write_text("\n".join(truth) + "\n")
    (out / "pairs.txt").write_text("".join(f"{x} {y}\n" for x, y in PAIRS))
    offset = max(abs(p - q) for a, b in zip(
        positions(out / "mh200k_X.off", 13380),
        positions(data / "full_m_rest.off", 13380)) for p, q in zip(a, b))
    assert offset < 0.01, "mh200k_X does not begin with the template's vertices"


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
