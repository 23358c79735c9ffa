"""Meshes and truths of sets of pairs, as isomatch-bench reads them: pairs.txt,
NAME.off, gt_X__Y.txt. For the scripts beside it that make such sets."""


def read_off(path):
    words = iter(path.read_text().split()[1:])
    n, m, _ = (int(next(words)) for _ in range(3))
    vertices = [tuple(float(next(words)) for _ in range(3)) for _ in range(n)]
    faces = []
    for _ in range(m):
        next(words)
        faces.append(tuple(int(next(words)) for _ in range(3)))
    return vertices, faces


def write_off(path, vertices, faces):
    with path.open("w") as out:
        out.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
        out.writelines("%r %r %r\n" % v for v in vertices)
        out.writelines("3 %d %d %d\n" % f for f in faces)


def read_truth(path):
    """Vertex of Y by vertex of X."""
    truth = {}
    for k, line in enumerate(path.read_text().splitlines()):
        words = line.split()
        if not words:
            continue
        x, y = (k, words[0]) if len(words) == 1 else words[:2]
        truth[int(x)] = int(y)
    return truth


def listed_pairs(sets):
    """(folder, X, Y) of every pair that a folder of `sets` has a truth of."""
    pairs = []
    for folder in sets:
        for line in (folder / "pairs.txt").read_text().splitlines():
            names = line.split()[:2]
            if names and (folder / "gt_{}__{}.txt".format(*names)).exists():
                pairs.append((folder, *names))
    return pairs


def submesh(mesh, faces):
    """The mesh of some faces, and the vertices of `mesh` that it keeps."""
    kept = sorted({v for f in faces for v in f})
    new = {v: k for k, v in enumerate(kept)}
    return ([mesh[0][v] for v in kept], [tuple(new[v] for v in f) for f in faces]), kept
