#!/usr/bin/env python3
"""Makes sets of other triangulations out of sets of whole shapes:
`isomatch-bench accuracy OUT/KIND`.

    make_mesh_pairs.py [--every NUMBER] OUT SET SET ...

SET: a folder of pairs as isomatch-bench reads them (pairs.txt, NAME.off,
gt_X__Y.txt). OUT gets a folder for each kind, of every NUMBERth pair (4):

    coarser    X of 1,200 vertices, and Y as it is
    finer      X as it is, and Y of four faces for each one
    stretched  X and Y of two fifths of the vertices, many triangles four times as
               long as wide, along another axis each

Vertices are removed by collapsing the shortest edges; those that stay keep their
place, so that the truth of those that both shapes have is exact.
"""
import argparse
import heapq
import math
import pathlib

from off_pairs import listed_pairs, read_off, read_truth, submesh, write_off

COARSE = 1200
STRETCH = 10.0


def normal_of(a, b, c):
    u = [b[i] - a[i] for i in range(3)]
    v = [c[i] - a[i] for i in range(3)]
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    length = math.sqrt(sum(x * x for x in n)) or 1.0
    return [x / length for x in n]


class Collapser:
    """Collapses the shortest edges onto one of their ends, shortest first."""

    def __init__(self, mesh, metric):
        self.places = mesh[0]
        self.metric = metric  # a factor for each axis, by which lengths are judged
        self.faces = dict(enumerate(mesh[1]))
        self.around = [set() for _ in mesh[0]]
        for f, corners in self.faces.items():
            for v in corners:
                self.around[v].add(f)

    def neighbors(self, v):
        return {u for f in self.around[v] for u in self.faces[f]} - {v}

    def length(self, a, b):
        return math.sqrt(sum((m * (p - q)) ** 2 for m, p, q in
                             zip(self.metric, self.places[a], self.places[b])))

    def may_collapse(self, gone, kept):
        if len(self.neighbors(gone) & self.neighbors(kept)) != 2:
            return False
        for f in self.around[gone]:
            if kept in self.faces[f]:
                continue
            now = [self.places[v] for v in self.faces[f]]
            moved = [self.places[kept if v == gone else v] for v in self.faces[f]]
            cosine = sum(a * b for a, b in zip(normal_of(*now), normal_of(*moved)))
            if cosine < 0.2:
                return False
        return True

    def collapse(self, gone, kept):
        for f in list(self.around[gone]):
            corners = self.faces[f]
            if kept in corners:
                for v in corners:
                    self.around[v].discard(f)
                del self.faces[f]
            else:
                self.faces[f] = tuple(kept if v == gone else v for v in corners)
                self.around[gone].discard(f)
                self.around[kept].add(f)

    def run(self, count):
        """Down to `count` vertices; returns the mesh and which are left."""
        left = sum(1 for faces in self.around if faces)
        heap = [(self.length(a, b), a, b) for f in self.faces.values()
                for a, b in zip(f, f[1:] + f[:1]) if a < b]
        heapq.heapify(heap)
        while left > count and heap:
            length, a, b = heapq.heappop(heap)
            if not self.around[a] or not self.around[b] or b not in self.neighbors(a):
                continue
            for gone, kept in ((b, a), (a, b)):
                if self.may_collapse(gone, kept):
                    self.collapse(gone, kept)
                    left -= 1
                    for v in sorted(self.neighbors(kept)):
                        heapq.heappush(heap, (self.length(kept, v), kept, v))
                    break
        return submesh((self.places, None), [self.faces[f] for f in sorted(self.faces)])


def coarsened(mesh, count):
    return Collapser(mesh, (1, 1, 1)).run(count)


def stretched(mesh, axis):
    metric = [1.0 / STRETCH if i == axis else 1.0 for i in range(3)]
    return Collapser(mesh, metric).run(len(mesh[0]) * 2 // 5)


def refined(mesh):
    """Each face in four; the old vertices come first."""
    places, middle, faces = list(mesh[0]), {}, []

    def between(a, b):
        key = min(a, b), max(a, b)
        if key not in middle:
            middle[key] = len(places)
            places.append(tuple(0.5 * (p + q) for p, q in zip(places[a], places[b])))
        return middle[key]

    for a, b, c in mesh[1]:
        ab, bc, ca = between(a, b), between(b, c), between(c, a)
        faces += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return (places, faces), list(range(len(mesh[0])))


def same(mesh):
    return mesh, list(range(len(mesh[0])))


KINDS = {
    "coarser": (lambda mesh: coarsened(mesh, COARSE), same),
    "finer": (same, refined),
    "stretched": (lambda mesh: stretched(mesh, 0), lambda mesh: stretched(mesh, 1)),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    parser.add_argument("sets", metavar="SET", nargs="+", type=pathlib.Path)
    given = parser.parse_args()
    listed = listed_pairs(given.sets)[::given.every]
    for kind, makers in KINDS.items():
        folder = given.out / kind
        folder.mkdir(parents=True, exist_ok=True)
        lines = []
        for number, (source, x, y) in enumerate(listed):
            made = [make(read_off(source / f"{name}.off"))
                    for make, name in zip(makers, (x, y))]
            (mesh_x, kept_x), (mesh_y, kept_y) = made
            names = f"{kind}{number}x", f"{kind}{number}y"
            write_off(folder / f"{names[0]}.off", *mesh_x)
            write_off(folder / f"{names[1]}.off", *mesh_y)
            truth = read_truth(source / f"gt_{x}__{y}.txt")
            new_y = {v: i for i, v in enumerate(kept_y)}
            known = [f"{i} {new_y[truth[v]]}\n" for i, v in enumerate(kept_x)
                     if truth.get(v) in new_y]
            (folder / f"gt_{names[0]}__{names[1]}.txt").write_text("".join(known))
            lines.append(f"{names[0]} {names[1]}\n")
        (folder / "pairs.txt").write_text("".join(lines))
        print(f"{kind}: {len(lines)} pairs in {folder}", flush=True)


if __name__ == "__main__":
    main()
