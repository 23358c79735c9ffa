#!/usr/bin/env python3
"""Makes a set of pairs that cannot be matched well, to see whether the verdict
says so: `isomatch-bench accuracy OUT`.

    make_verdict_pairs.py [--seed NUMBER] OUT SET SET ...

SET: a folder of pairs as isomatch-bench reads them (pairs.txt, NAME.off,
gt_X__Y.txt). OUT gets 20 pairs of a half of X,
cut by a plane, and Y; 10 of X in triangles that do not hang together, and Y; 10
of faces between any vertices, and Y; and 30 of shapes of unlike sets (cats and
bodies), chosen by chance, the same ones for the same seed (1 by default). What
has no right map gets a truth by chance, so that every map of it is wrong.
"""
import argparse
import math
import pathlib
import random

from off_pairs import listed_pairs, read_off, read_truth, submesh, write_off


def kind(name):
    """cat3 is a cat; all bodies of people are one kind."""
    word = name.rstrip("0123456789")
    return word if word in ("cat", "dog", "horse", "wolf", "centaur") else "body"


class Maker:
    def __init__(self, out, sets, seed):
        self.out, self.pairs, self.dice = out, [], random.Random(seed)
        self.shapes = sorted({p for s in sets for p in s.glob("*.off")})
        self.listed = listed_pairs(sets)

    def add(self, name, mesh_x, path_y, truth):
        """truth: lines of gt_X__Y.txt, None for one by chance."""
        name_y = path_y.stem
        write_off(self.out / f"{name}.off", *mesh_x)
        (self.out / f"{name_y}.off").write_bytes(path_y.read_bytes())
        if truth is None:
            n = len(read_off(path_y)[0])
            truth = [f"{x} {self.dice.randrange(n)}" for x in range(len(mesh_x[0]))]
        (self.out / f"gt_{name}__{name_y}.txt").write_text("\n".join(truth) + "\n")
        self.pairs.append(f"{name} {name_y}")

    def half(self, i):
        folder, x, y = self.dice.choice(self.listed)
        vertices, faces = read_off(folder / f"{x}.off")
        normal = [self.dice.gauss(0, 1) for _ in range(3)]
        heights = [sum(a * b for a, b in zip(v, normal)) for v in vertices]
        cut = sorted(heights)[int(len(heights) * self.dice.uniform(0.35, 0.65))]
        faces = [f for f in faces if all(heights[v] >= cut for v in f)]
        mesh, kept = submesh((vertices, faces), faces)
        truth = read_truth(folder / f"gt_{x}__{y}.txt")
        lines = [f"{k} {truth[v]}" for k, v in enumerate(kept) if v in truth]
        self.add(f"half{i}", mesh, folder / f"{y}.off", lines)

    def soup(self, i):
        folder, x, y = self.dice.choice(self.listed)
        vertices, faces = read_off(folder / f"{x}.off")
        size = max(map(math.dist, vertices, vertices[1:]))
        corners = [tuple(c + self.dice.uniform(-1e-6, 1e-6) * size for c in vertices[v])
                   for f in faces for v in f]
        self.add(f"soup{i}", (corners, [(k, k + 1, k + 2) for k in range(0, len(corners), 3)]),
                 folder / f"{y}.off", None)

    def any_faces(self, i):
        n = 1200  # more are refused
        vertices = [tuple(self.dice.gauss(0, 1) for _ in range(3)) for _ in range(n)]
        faces = [tuple(self.dice.sample(range(n), 3)) for _ in range(2 * n)]
        self.add(f"any{i}", (vertices, faces), self.dice.choice(self.shapes), None)

    def unlike(self, i):
        while True:
            x, y = self.dice.sample(self.shapes, 2)
            if (kind(x.stem) == "body") != (kind(y.stem) == "body"):
                break
        self.add(f"unlike{i}", read_off(x), y, None)


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("sets", type=pathlib.Path, nargs="+")
    arguments = parser.parse_args()
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    maker = Maker(out, arguments.sets, arguments.seed)
    for make, count in ((maker.half, 20), (maker.soup, 10), (maker.any_faces, 10),
                        (maker.unlike, 30)):
        for i in range(count):
            make(i)
    (out / "pairs.txt").write_text("\n".join(maker.pairs) + "\n")


if __name__ == "__main__":
    main()
