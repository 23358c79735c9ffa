#!/usr/bin/env python3
"""Makes sets of parts out of sets of whole shapes: `isomatch-bench accuracy OUT/KIND`.

    make_part_pairs.py [--seed NUMBER] [--count COUNT] [--scale] OUT SET SET ...

SET: a folder of pairs as isomatch-bench reads them (pairs.txt, NAME.off,
gt_X__Y.txt). OUT gets a folder for each kind, of COUNT pairs (40) that are chosen
by chance, the same ones for the same seed (1 by default):

    views    what of X is seen from one side, as a range scanner samples it, and Y
    halves   a part of X, and Y
    holed    X with ten holes, and Y
    nested   a part of X, and a part of Y that has all of that
    turned   the same, Y as X
    alike    X and Y, cut in the same way
    overlap  X and Y, cut in two ways

A vertex of X whose place Y lacks has the truth -1.

X has the unit of Y, in which the two whole shapes have the same area: sets of whole
shapes, such as FAUST_r, need not have one unit. With --scale it is 0.5 to 2 times as
large.
"""
import argparse
import collections
import math
import pathlib
import random

from off_pairs import listed_pairs, read_off, read_truth, submesh, write_off

KINDS = ("views", "halves", "holed", "nested", "turned", "alike", "overlap")


def minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


def area_of(mesh):
    vertices, faces = mesh
    return sum(math.hypot(*cross(minus(vertices[b], vertices[a]),
                                 minus(vertices[c], vertices[a])))
               for a, b, c in faces) / 2


def neighbors_of(mesh):
    neighbors = [set() for _ in mesh[0]]
    for f in mesh[1]:
        for v in f:
            neighbors[v].update(f)
    return neighbors


def spread(mesh, known):
    """Gives every vertex what the nearest one has, over edges, that has something."""
    neighbors = neighbors_of(mesh)
    found = dict(known)
    queue = collections.deque(sorted(known))
    while queue:
        v = queue.popleft()
        for other in sorted(neighbors[v]):
            if other not in found:
                found[other] = found[v]
                queue.append(other)
    return found


def largest_component(mesh):
    neighbors = neighbors_of(mesh)
    best, seen = [], set()
    for start in range(len(mesh[0])):
        if start in seen:
            continue
        component = [start]
        seen.add(start)
        for v in component:
            for other in neighbors[v]:
                if other not in seen:
                    seen.add(other)
                    component.append(other)
        if len(component) > len(best):
            best = component
    best = set(best)
    return [f for f in mesh[1] if f[0] in best]


def part(mesh, is_kept):
    """The largest piece where `is_kept`, and the vertices of `mesh` it has."""
    cut, kept = submesh(mesh, [f for f in mesh[1] if all(is_kept(v) for v in f)])
    piece, of_cut = submesh(cut, largest_component(cut))
    return piece, [kept[v] for v in of_cut]


class Nearness:
    """Whether two vertices are some edges apart at most."""

    EDGES = 5

    def __init__(self, mesh):
        self.neighbors = neighbors_of(mesh)
        self.around = {}

    def __call__(self, a, b):
        if a not in self.around:
            ring = found = {a}
            for _ in range(self.EDGES):
                ring = {other for v in ring for other in self.neighbors[v]} - found
                found = found | ring
            self.around[a] = found
        return b in self.around[a]


def scan(mesh, direction):
    """What is seen of the mesh against `direction`, sampled at the steps of a
    grid half as wide as a mean edge; and of each vertex of the mesh that is seen
    the point nearest to it, by its barycentric coordinate.
    Where one limb hides another they are not joined, even if they touch."""
    vertices, faces = mesh
    are_near = Nearness(mesh)
    edges = [math.dist(vertices[f[0]], vertices[f[1]]) for f in faces]
    step = 0.5 * sum(edges) / len(edges)
    right = unit(cross(direction, (0.3, 0.5, 0.8)))
    up = cross(direction, right)
    flat = [(dot(v, right) / step, dot(v, up) / step, dot(v, direction)) for v in vertices]
    hits = {}  # (column, row): height above the grid, face, weights
    for f in faces:
        a, b, c = (flat[v] for v in f)
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if abs(area) < 1e-12:
            continue
        for i in range(math.ceil(min(a[0], b[0], c[0])), math.floor(max(a[0], b[0], c[0])) + 1):
            for j in range(math.ceil(min(a[1], b[1], c[1])),
                           math.floor(max(a[1], b[1], c[1])) + 1):
                u = ((i - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (j - a[1])) / area
                w = ((b[0] - a[0]) * (j - a[1]) - (i - a[0]) * (b[1] - a[1])) / area
                if u < 0 or w < 0 or u + w > 1:
                    continue
                height = a[2] + u * (b[2] - a[2]) + w * (c[2] - a[2])
                if (i, j) not in hits or height > hits[i, j][0]:
                    hits[i, j] = height, f, (1 - u - w, u, w)
    index, points, nearest, shares = {}, [], [], []
    for place in sorted(hits):
        _, f, weights = hits[place]
        index[place] = len(points)
        points.append(tuple(sum(w * vertices[v][k] for w, v in zip(weights, f))
                            for k in range(3)))
        corner = max(range(3), key=lambda k: weights[k])
        nearest.append(f[corner])
        shares.append(weights[corner])
    triangles = []
    for i, j in sorted(hits):
        for corners in (((i, j), (i + 1, j), (i, j + 1)),
                        ((i + 1, j), (i + 1, j + 1), (i, j + 1))):
            if not all(corner in index for corner in corners):
                continue
            a, b, c = (index[corner] for corner in corners)
            if all(math.dist(points[p], points[q]) < 5 * step
                   and are_near(nearest[p], nearest[q])
                   for p, q in ((a, b), (b, c), (c, a))):
                facing = dot(cross(minus(points[b], points[a]), minus(points[c], points[a])),
                             direction)
                triangles.append((a, b, c) if facing > 0 else (a, c, b))
    seen = points, triangles
    piece, kept = submesh(seen, largest_component(seen))
    point_of = {}  # vertex of the mesh: its share in a point, the point
    for k, v in enumerate(kept):
        point_of[nearest[v]] = max(point_of.get(nearest[v], (0, 0)), (shares[v], k))
    vertices = [None] * len(kept)
    for vertex, (_, k) in point_of.items():
        vertices[k] = vertex
    return piece, vertices


class Maker:
    def __init__(self, out, sets, arguments):
        self.seed = arguments.seed
        self.out, self.scaled = out, arguments.scale
        self.listed = listed_pairs(sets)
        self.pairs = collections.defaultdict(list)

    def make(self, kind, number):
        self.dice = random.Random(f"{self.seed} {kind} {number}")
        getattr(self, kind)(number)

    def direction(self):
        return unit([self.dice.gauss(0, 1) for _ in range(3)])

    def draw(self):
        folder, x, y = self.dice.choice(self.listed)
        mesh_x, mesh_y = read_off(folder / f"{x}.off"), read_off(folder / f"{y}.off")
        self.known = read_truth(folder / f"gt_{x}__{y}.txt")
        truth = spread(mesh_x, self.known)
        unit_y = math.sqrt(area_of(mesh_y) / area_of(mesh_x))
        in_y = [tuple(unit_y * c for c in v) for v in mesh_x[0]]
        return (in_y, mesh_x[1]), mesh_y, truth

    def depths(self, mesh_x, mesh_y, truth):
        """From 0 to 1 in a direction of X, on both shapes."""
        normal = self.direction()
        heights = [dot(v, normal) for v in mesh_x[0]]
        order = sorted(range(len(heights)), key=heights.__getitem__)
        depth_x = [0.0] * len(order)
        for rank, v in enumerate(order):
            depth_x[v] = rank / len(order)
        on_y = spread(mesh_y, {y: depth_x[x] for x, y in truth.items()})
        return depth_x, on_y

    def add(self, kind, number, x, y, truth):
        """x, y: a mesh and the vertices of the whole one that it has."""
        folder = self.out / kind
        folder.mkdir(parents=True, exist_ok=True)
        (mesh_x, whole_x), (mesh_y, whole_y) = x, y
        scale = self.dice.uniform(0.5, 2) if self.scaled else 1
        names = f"{kind}{number}x", f"{kind}{number}y"
        write_off(folder / f"{names[0]}.off",
                  [tuple(scale * c for c in v) for v in mesh_x[0]], mesh_x[1])
        write_off(folder / f"{names[1]}.off", *mesh_y)
        new = {v: k for k, v in enumerate(whole_y)}
        lines = [f"{k} {new.get(truth[v], -1)}" for k, v in enumerate(whole_x)
                 if v in truth]
        (folder / "gt_{}__{}.txt".format(*names)).write_text("\n".join(lines) + "\n")
        self.pairs[kind].append(" ".join(names))

    def views(self, number):
        mesh_x, mesh_y, truth = self.draw()
        # From where much is seen, as one would stand.
        seen = max((scan(mesh_x, self.direction()) for _ in range(3)),
                   key=lambda view: len(view[0][0]))
        self.add("views", number, seen, self.whole(mesh_y), self.known)

    def whole(self, mesh):
        return mesh, range(len(mesh[0]))

    def halves(self, number):
        mesh_x, mesh_y, truth = self.draw()
        depth, _ = self.depths(mesh_x, mesh_y, truth)
        cut = self.dice.uniform(0.4, 0.6)
        self.add("halves", number, part(mesh_x, lambda v: depth[v] >= cut),
                 self.whole(mesh_y), truth)

    def holed(self, number):
        mesh_x, mesh_y, truth = self.draw()
        vertices = mesh_x[0]
        size = max(math.dist(v, vertices[0]) for v in vertices)
        holes = [(self.dice.choice(vertices), size * self.dice.uniform(0.02, 0.06))
                 for _ in range(10)]
        left = part(mesh_x, lambda v: all(math.dist(vertices[v], center) > radius
                                          for center, radius in holes))
        self.add("holed", number, left, self.whole(mesh_y), truth)

    def cut_two(self, kind, number, bounds_x, bounds_y):
        mesh_x, mesh_y, truth = self.draw()
        depth_x, depth_y = self.depths(mesh_x, mesh_y, truth)
        x = part(mesh_x, lambda v: bounds_x[0] <= depth_x[v] <= bounds_x[1])
        y = part(mesh_y, lambda v: bounds_y[0] <= depth_y.get(v, -1) <= bounds_y[1])
        self.add(kind, number, x, y, truth)

    def nested(self, number):
        self.cut_two("nested", number, (self.dice.uniform(0.4, 0.55), 1),
                     (self.dice.uniform(0.1, 0.25), 1))

    def turned(self, number):
        self.cut_two("turned", number, (self.dice.uniform(0.1, 0.25), 1),
                     (self.dice.uniform(0.4, 0.55), 1))

    def alike(self, number):
        cut = self.dice.uniform(0.2, 0.5)
        self.cut_two("alike", number, (cut, 1), (cut, 1))

    def overlap(self, number):
        self.cut_two("overlap", number, (self.dice.uniform(0.2, 0.35), 1),
                     (0, self.dice.uniform(0.65, 0.8)))


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--scale", action="store_true")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("sets", type=pathlib.Path, nargs="+")
    arguments = parser.parse_args()
    maker = Maker(arguments.out, arguments.sets, arguments)
    for kind in KINDS:
        for i in range(arguments.count):
            maker.make(kind, i)
    for kind, pairs in maker.pairs.items():
        (arguments.out / kind / "pairs.txt").write_text("\n".join(pairs) + "\n")


if __name__ == "__main__":
    main()
