"""What client/python/examples/from_trimesh.py uses of trimesh, for where there is none."""

import numpy as np

import isomatch


class _Visual:
    vertex_colors = None


class Trimesh:
    def __init__(self, vertices, faces, process=True):
        assert process is False
        self.vertices, self.faces = np.asarray(vertices), np.asarray(faces)
        self.visual = _Visual()

    def export(self, path):
        assert len(self.visual.vertex_colors) == len(self.vertices)
        rows = "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in self.vertices.tolist())
        faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in self.faces.tolist())
        header = (
            f"ply\nformat ascii 1.0\nelement vertex {len(self.vertices)}\nproperty float x\n"
            f"property float y\nproperty float z\nelement face {len(self.faces)}\n"
            "property list uchar int vertex_indices\nend_header\n"
        )
        with open(path, "w") as file:
            file.write(header + rows + faces)


def load(path, process=True):
    return Trimesh(*isomatch.read_mesh(path), process)
