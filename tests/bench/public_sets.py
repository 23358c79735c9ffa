"""Sets of pairs of meshes in public repositories: where they are, which pairs are taken,
and what their truth is."""

import dataclasses
import pathlib
import random
import re
import shlex
import subprocess

import numpy as np


class SetError(Exception):
    """Why a set cannot be made, and the command that helps, if there is one."""

    def __init__(self, why, remedy=None):
        super().__init__(why)
        self.remedy = remedy


@dataclasses.dataclass(frozen=True)
class Repository:
    """A repository of GitHub at one commit, so that its files are the same for all."""

    owner: str
    name: str
    commit: str

    @property
    def folder(self):
        return f"{self.owner}+{self.name}"

    @property
    def url(self):
        return f"https://github.com/{self.owner}/{self.name}"


@dataclasses.dataclass(frozen=True)
class Mesh:
    vertices: np.ndarray  # n x 3
    faces: np.ndarray  # m x 3, counted from 0
    published: bytes  # the OFF file that it was read from


@dataclasses.dataclass(frozen=True)
class Pair:
    name_x: str
    name_y: str
    mesh_x: Mesh
    mesh_y: Mesh
    truth: np.ndarray  # rows x, y or x, y, y_mirrored, counted from 0; y = -1 for none


class Clone:
    """A clone of a repository (bare or not), of which files are read at its commit."""

    def __init__(self, snapshots, repository):
        self.folder = pathlib.Path(snapshots) / repository.folder
        self.commit = repository.commit
        quoted = shlex.quote(str(self.folder))
        candidates = (self.folder / ".git", self.folder)
        self.git_dir = next((d for d in candidates if (d / "objects").is_dir()), None)
        if self.git_dir is None:
            raise SetError(f"there is no clone in {self.folder}",
                           f"git clone {repository.url} {quoted}")  # fmt: skip
        if self._git("cat-file", "-e", f"{self.commit}^{{commit}}") is None:
            raise SetError(f"the clone in {self.folder} has no commit {self.commit}",
                           f"git -C {quoted} fetch origin {self.commit}")  # fmt: skip

    def _git(self, *arguments):
        """Returns what a command of git prints, None where it fails."""
        command = ["git", f"--git-dir={self.git_dir}", *arguments]
        answer = subprocess.run(command, capture_output=True, check=False)
        return answer.stdout if answer.returncode == 0 else None

    def place(self, path):
        """How messages name a file."""
        return f"{self.folder}, {self.commit[:7]}:{path}"

    def read(self, path):
        data = self._git("show", f"{self.commit}:{path}")
        if data is None:
            raise SetError(f"{self.place(path)}: there is no such file, or it cannot be read")
        return data

    def names(self, folder, end):
        """Returns the paths of the files below a folder that end so, in order."""
        listed = self._git("ls-tree", "-r", "--name-only", self.commit, folder + "/")
        found = [path for path in (listed or b"").decode().splitlines() if path.endswith(end)]
        if not found:
            raise SetError(f"{self.place(folder)}: there is no file that ends in {end}")
        return found

    def numbers(self, path, columns):
        """Returns the numbers of a text file, so many a row."""
        try:
            return np.array(self.read(path).split(), float).reshape(-1, columns)
        except ValueError as error:
            raise SetError(f"{self.place(path)}: expected rows of {columns} numbers "
                           f"({error})") from error  # fmt: skip

    def indices(self, path):
        """Returns the vertices of a file, one a line, counted as there."""
        return self.numbers(path, 1)[:, 0].astype(int)

    def mesh(self, path):
        data = self.read(path)
        words = data.split()
        try:
            n, m = int(words[1]), int(words[2])
            vertices = np.array(words[4 : 4 + 3 * n], float).reshape(n, 3)
            faces = np.array(words[4 + 3 * n : 4 + 3 * n + 4 * m], float).astype(int)
            return Mesh(vertices, faces.reshape(m, 4)[:, 1:], data)
        except (IndexError, ValueError) as error:
            raise SetError(f"{self.place(path)}: expected an OFF file of triangles "
                           f"({error})") from error  # fmt: skip


def stem(path):
    return pathlib.PurePosixPath(path).stem


def numbered(*columns):
    """Returns a truth of all vertices of X from their vertices of Y."""
    return np.column_stack([np.arange(len(columns[0])), *columns])


def corners(mesh, rows, first):
    """Returns the corner next to each point on a mesh, given as rows of a triangle, counted
    from `first`, and three weights."""
    return mesh.faces[rows[:, 0].astype(int) - first, rows[:, 1:].argmax(axis=1)]


def nearest(points, targets):
    """Returns the index of the target nearest to each point, and its distance."""
    index, distance = [], []
    for block in np.array_split(points, len(points) // 256 + 1):
        squared = ((block[:, None, :] - targets[None, :, :]) ** 2).sum(axis=2)
        index.append(squared.argmin(axis=1))
        distance.append(np.sqrt(squared.min(axis=1)))
    return np.concatenate(index), np.concatenate(distance)


# What follows takes a fixed part of each data set. The rest is left for judging by shapes
# that nobody tuned on, so do not widen these choices.


def bcicp(clone, source, taken, step):
    """Every `step`-th of the published test pairs of which both shapes are taken."""
    base = f"Dataset/{source}"
    lines = clone.read(f"{base}/test_pairs.txt").decode().splitlines()
    pairs = [[word.removesuffix(".off") for word in line.split()[:2]] for line in lines if line]
    pairs = [pair for pair in pairs if all(re.fullmatch(taken, name) for name in pair)]
    for x, y in pairs[::step]:
        mesh_x, mesh_y = (clone.mesh(f"{base}/vtx_5k/{name}.off") for name in (x, y))
        ends = (f"{x}.vts", f"{y}.vts", f"{y}.sym.vts")
        truth = [clone.indices(f"{base}/vtx_5k/corres/{end}") - 1 for end in ends]
        yield Pair(x, y, mesh_x, mesh_y, np.column_stack(truth))


SHREC16 = "dataset/shrec"


def shrec16_partial(clone, kind):
    """Cuts or holes against the whole shape of their class."""
    for path in clone.names(f"{SHREC16}/{kind}", ".off"):
        found = re.search(r"_(cat|dog|michael)_shape", path)
        if not found:
            continue
        null = clone.mesh(f"{SHREC16}/null/{found[1]}.off")
        truth = [corners(null, clone.numbers(path[:-4] + end, 4), first=1)
                 for end in (".baryc_gt", ".baryc_gt_sym")]  # fmt: skip
        yield Pair(stem(path), found[1], clone.mesh(path), null, numbered(*truth))


def places_on(clone, null, name):
    """Where the vertices of a cut lie on the whole shape."""
    rows = clone.numbers(f"{SHREC16}/cuts/{name}.baryc_gt", 4)
    corner = null.vertices[null.faces]
    return (corner[rows[:, 0].astype(int) - 1] * rows[:, 1:, None]).sum(axis=1)


def mean_edge(mesh):
    corner = mesh.vertices[mesh.faces]
    return np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).mean()


def shrec16_turned(clone):
    """The whole shape of a class against its cuts, which lack most of it."""
    for path in clone.names(f"{SHREC16}/cuts", ".off"):
        found = re.search(r"_(cat|dog|michael)_shape", path)
        if not found:
            continue
        null = clone.mesh(f"{SHREC16}/null/{found[1]}.off")
        index, distance = nearest(null.vertices, places_on(clone, null, stem(path)))
        truth = np.where(distance < 0.8 * mean_edge(null), index, -1)
        yield Pair(found[1], stem(path), null, clone.mesh(path), numbered(truth))


def shrec16_parts(clone):
    """Two cuts of one class that share a quarter to all but a twentieth of the first."""
    names = [stem(path) for path in clone.names(f"{SHREC16}/cuts", ".off")]
    for kind in ("cat", "dog", "michael"):
        null = clone.mesh(f"{SHREC16}/null/{kind}.off")
        edge = mean_edge(null)

        def places(name, null=null):
            return places_on(clone, null, name)

        members = [name for name in names if f"_{kind}_" in name]
        dice, made = random.Random(kind), 0
        while made < 5:
            x, y = dice.sample(members, 2)
            index, distance = nearest(places(x), places(y))
            shared = distance < 0.8 * edge
            if not 0.25 <= shared.mean() <= 0.95:
                continue
            made += 1
            mesh_x, mesh_y = (clone.mesh(f"{SHREC16}/cuts/{name}.off") for name in (x, y))
            yield Pair(x, y, mesh_x, mesh_y, numbered(np.where(shared, index, -1)))


def topkids(clone):
    """Every second child against the first, on which no parts touch."""
    whole = clone.mesh("meshes/kid00.off")
    for kid in range(1, 26, 2):
        name = f"kid{kid:02}"
        rows, mirrored = (clone.numbers(f"meshes/{name}_{end}.txt", 2).astype(int) - 1
                          for end in ("ref", "sym"))  # fmt: skip
        mirror = dict(map(tuple, mirrored))
        truth = np.array([(x, y, mirror.get(x, y)) for x, y in rows])
        yield Pair(name, "kid00", clone.mesh(f"meshes/{name}.off"), whole, truth)


def of_one_template(clone, shapes, most_shapes, pairs, seed):
    """Pairs by chance of shapes with a list of the vertices of one template."""
    names = sorted(stem(path) for path in clone.names(shapes, ".off"))[:most_shapes]
    folder = shapes.rpartition("/")[0] + "/corres"
    all_pairs = [(x, y) for x in names for y in names if x != y]
    for x, y in sorted(random.Random(seed).sample(all_pairs, pairs)):
        truth = [clone.indices(f"{folder}/{name}.vts") - 1 for name in (x, y)]
        mesh_x, mesh_y = (clone.mesh(f"{shapes}/{name}.off") for name in (x, y))
        yield Pair(x, y, mesh_x, mesh_y, np.column_stack(truth))


def cats_and_dogs(clone):
    """Poses by chance; the truth is that of the two rest poses."""
    poses = {}
    for path in clone.names("data/tosca-off", ".off"):
        found = re.fullmatch(r"([a-z]+)(\d+)", stem(path))
        if found:
            poses.setdefault(found[1], []).append(int(found[2]))
    for x, y in (("cat", "dog"), ("dog", "cat")):
        rest = clone.mesh(f"data/tosca-off/{y}0.off")
        rows = clone.numbers(f"precomputed_corr_templates/tosca_{x}0_tosca_{y}0_corres.txt", 4)
        truth = numbered(corners(rest, rows, first=0))
        all_pairs = [(i, j) for i in sorted(poses[x]) for j in sorted(poses[y])]
        for i, j in random.Random(x + y).sample(all_pairs, 6):
            names = (f"{x}{i}", f"{y}{j}")
            mesh_x, mesh_y = (clone.mesh(f"data/tosca-off/{name}.off") for name in names)
            if len(mesh_x.vertices) == len(truth) and np.array_equal(mesh_y.faces, rest.faces):
                yield Pair(*names, mesh_x, mesh_y, truth)


def smal_parts(clone):
    """Published pairs by chance."""
    folder = "PARTIALSMAL/train"
    paths = sorted(clone.names(f"{folder}/maps", ".vts"))
    for path in sorted(random.Random(7).sample(paths, 20)):
        cut = r"cuts_\d+_[a-z]+_\d+"
        x, y = re.fullmatch(f"({cut})_({cut})", stem(path)).groups()
        mesh_x, mesh_y = (clone.mesh(f"{folder}/shapes/{name}.off") for name in (x, y))
        yield Pair(x, y, mesh_x, mesh_y, numbered(clone.indices(path)))


def shrec07(clone):
    """Pairs by chance of one class whose lists of landmarks are equally long."""
    base = "Trilateral/Mesh/SCB/Data/watertight_shrec07"
    have = {stem(path) for path in clone.names(f"{base}/Corrs", ".vts")}
    for kind, first in (("fourleg", 381), ("hand", 181), ("teddy", 161)):
        members = [i for i in range(first, first + 20) if str(i) in have]
        dice, made = random.Random(kind), set()
        while len(made) < 6:
            x, y = dice.sample(members, 2)
            landmarks = [clone.numbers(f"{base}/Corrs/{i}.vts", 4)[:, 0] for i in (x, y)]
            if len(landmarks[0]) != len(landmarks[1]) or (x, y) in made:
                continue
            made.add((x, y))
            mesh_x, mesh_y = (clone.mesh(f"{base}/Meshes/{i}.off") for i in (x, y))
            yield Pair(f"{kind}{x}", f"{kind}{y}", mesh_x, mesh_y, np.column_stack(landmarks))


BCICP = Repository("llorz", "SGA18_orientation_BCICP_dataset",
                   "ca33927be7147ba7070ac5457fd3084967931b48")  # fmt: skip
SHREC = Repository("tsachiblau", "geometricComputerVisionProject",
                   "7f0caf9168efe65f8189e59898399a426fde1148")  # fmt: skip
KIDS = Repository("cansin", "geometry-processing", "55da6e850e0b27966e158f57128d58c5967ba6a0")
DUO_FM = Repository("nicolasdonati", "DUO-FM", "3218e60b568176fb2d4dc32427ed382fe9a501c1")
BECOS = Repository("NafieAmrani", "becos-code", "409555278ce53fd620e76066cc6225042818c138")
PPSM = Repository("vikiehm", "gc-ppsm", "589b7710d0187583b413acb78e36b70bbf0051ef")
SYMMETRY = Repository("Batucan2601", "Intrinsic-Symmetry-Curve-Generation-",
                      "85cdce6ba77c5ea8f6e4518fb2dde848b8ebfe2f")  # fmt: skip


@dataclasses.dataclass(frozen=True)
class PublicSet:
    repository: Repository
    what: str
    num_pairs: int
    pairs: object  # of a Clone: yields each Pair
    keeps_files: bool = False  # meshes are copied as published, else written anew


SETS = {
    "faust5k": PublicSet(
        BCICP, "FAUST, remeshed", 97,
        lambda clone: bcicp(clone, "FAUST", r"tr_reg_0[0-4]\d", 1), keeps_files=True),
    "tosca5k": PublicSet(
        BCICP, "TOSCA within a class, remeshed", 60,
        lambda clone: bcicp(clone, "TOSCA_Isometric", r"(cat|dog|horse|michael)\d+", 3),
        keeps_files=True),
    "cuts": PublicSet(
        SHREC, "SHREC'16, a part to its whole", 45, lambda clone: shrec16_partial(clone, "cuts")),
    "cutsturned": PublicSet(SHREC, "SHREC'16, a whole to its part", 45, shrec16_turned),
    "holes": PublicSet(
        SHREC, "SHREC'16, with holes to its whole", 30,
        lambda clone: shrec16_partial(clone, "holes")),
    "parts": PublicSet(SHREC, "SHREC'16, part to part", 15, shrec16_parts),
    "topkids": PublicSet(KIDS, "TOPKIDS, merged limbs", 13, topkids),
    "smal": PublicSet(
        DUO_FM, "SMAL, animals across species", 30,
        lambda clone: of_one_template(clone, "data/SMAL_r/shapes_train", None, 30, "smal")),
    "animals": PublicSet(BECOS, "TOSCA, cats and dogs", 12, cats_and_dogs),
    "partsmal": PublicSet(PPSM, "SMAL, parts across species", 20, smal_parts),
    "shrec07": PublicSet(SYMMETRY, "SHREC'07 within a class, landmarks", 18, shrec07),
    "aniso": PublicSet(
        DUO_FM, "FAUST, anisotropic triangles", 10,
        lambda clone: of_one_template(clone, "data/FAUST_a/shapes_test", 10, 10, "aniso")),
}  # fmt: skip
