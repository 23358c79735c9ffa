#!/usr/bin/env python3
"""Makes sets of pairs for `scripts/bench accuracy` out of clones of public repositories.

SNAPSHOTS is a folder of your own that holds the clones; run this first, and it prints a
git clone line for each that is missing. OUT gets a folder for each SET, by default all:
meshes NAME.off, truths gt_X__Y.txt (lines "x y [y_mirrored]", counted from 0; y = -1 where
Y has no counterpart) and pairs.txt.

The shapes have research terms: evaluate with them on your own machine and commit none.
"""

import argparse
import pathlib
import sys

import numpy as np
from public_sets import SETS, Clone, SetError

PLACES = ("published", "rotated", "scaled", "both")


def table():
    rows = [f"  {name:9} {s.num_pairs:3} pairs  {s.what:36} {s.repository.folder}"
            for name, s in SETS.items()]  # fmt: skip
    return "\n".join(["sets:", *rows])


def arguments():
    parser = argparse.ArgumentParser(
        prog="scripts/bench fetch-sets", description=__doc__, epilog=table(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("snapshots", metavar="SNAPSHOTS", type=pathlib.Path)
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    parser.add_argument("sets", metavar="SET", nargs="*", help="only these of the sets below")
    parser.add_argument("--place", choices=PLACES, default=PLACES[0],
                        help="turn every Y, scale it by 0.5 to 2, or both, by chance but "
                             "always in the same way (default: as published)")  # fmt: skip
    given = parser.parse_args()
    for name in given.sets:
        if name not in SETS:
            parser.error(f"SET is {name}, expected one of {', '.join(SETS)}")
    return given


def placed(vertices, name, place):
    """Returns vertices turned and scaled by what the name of their shape chooses."""
    dice = np.random.default_rng(list(name.encode()))
    turn, upper = np.linalg.qr(dice.normal(size=(3, 3)))
    turn = turn * np.sign(np.diag(upper))
    turn[:, 0] *= np.linalg.det(turn)  # no reflection
    if place in ("rotated", "both"):
        vertices = vertices @ turn.T
    if place in ("scaled", "both"):
        vertices = vertices * 2 ** dice.uniform(-1, 1)
    return vertices


def write_off(path, vertices, faces):
    with path.open("w") as out:
        out.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
        np.savetxt(out, vertices, "%.9g")
        np.savetxt(out, faces, "3 %d %d %d")


def make(name, clone, folder, place):
    """Writes the set of a name; its pairs.txt last, so that no half set is taken for one."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pairs.txt").unlink(missing_ok=True)
    written, lines = set(), []

    def write_mesh(shape, mesh, how):
        path = folder / f"{shape}.off"
        if shape in written:
            return
        written.add(shape)
        if how == "published" and SETS[name].keeps_files:
            path.write_bytes(mesh.published)
        else:
            write_off(path, placed(mesh.vertices, shape, how), mesh.faces)

    for pair in SETS[name].pairs(clone):
        x, y = pair.name_x, pair.name_y
        if place != "published":
            y = f"{y}_{place}_for_{x}"
        write_mesh(x, pair.mesh_x, "published")
        write_mesh(y, pair.mesh_y, place)
        np.savetxt(folder / f"gt_{x}__{y}.txt", pair.truth, "%d")
        lines.append(f"{x} {y}\n")
    (folder / "pairs.txt").write_text("".join(lines))
    print(f"{name}: {len(lines)} pairs in {folder}", flush=True)


def main():
    given = arguments()
    failed, remedies = False, {}
    for name in given.sets or SETS:
        try:
            clone = Clone(given.snapshots, SETS[name].repository)
            make(name, clone, given.out / name, given.place)
        except (SetError, OSError) as error:
            failed = True
            print(f"scripts/bench fetch-sets: {name} is not made: {error}", file=sys.stderr)
            remedies[getattr(error, "remedy", None)] = True
    commands = [f"  {command}" for command in remedies if command]
    if commands:
        print("These commands get what is missing:", *commands, sep="\n", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
