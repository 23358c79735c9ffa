"""Carries what Y has at its vertices to X: transfer_texture.py X Y OUT.ply

Here Y is painted with stripes and given texture coordinates; X, another pose
with another triangulation, gets both through the map. OUT.ply is X with colors:
open it in MeshLab or Blender.
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

import isomatch

Array = NDArray[Any]


def paint(vertices: Array) -> Array:
    """Stripes across the longest axis, n x 3 colors."""
    span = np.ptp(vertices, axis=0)
    along = (vertices - vertices.min(axis=0)) / span
    stripe = np.floor(12 * along[:, np.argmax(span)]).astype(int) % 3
    colors: Array = np.array([[230, 80, 60], [250, 220, 120], [60, 110, 180]], np.uint8)
    painted: Array = colors[stripe]
    return painted


def unwrap(vertices: Array) -> Array:
    """Texture coordinates from the side, n x 2."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    unit: Array = (vertices - low) / (high - low)
    return unit[:, [0, 2]]


def write_ply(path: str, vertices: Array, faces: Array, colors: Array, uv: Array) -> None:
    with open(path, "w", encoding="ascii") as file:
        file.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n")
        file.write("".join(f"property float {axis}\n" for axis in ("x", "y", "z", "s", "t")))
        file.write("".join(f"property uchar {name}\n" for name in ("red", "green", "blue")))
        file.write(f"element face {len(faces)}\nproperty list uchar int vertex_indices\n")
        file.write("end_header\n")
        for (x, y, z), (s, t), (r, g, b) in zip(vertices, uv, colors):
            file.write(f"{x:.6g} {y:.6g} {z:.6g} {s:.6g} {t:.6g} {r} {g} {b}\n")
        for a, b, c in faces:
            file.write(f"3 {a} {b} {c}\n")


def main() -> None:
    x_path, y_path, output = sys.argv[1:]
    vertices_x, faces_x = isomatch.read_mesh(x_path)
    vertices_y, faces_y = isomatch.read_mesh(y_path)
    result = isomatch.match((vertices_x, faces_x), (vertices_y, faces_y))

    # Colors and labels: those of the one vertex that the map names.
    colors_x = result.transfer(paint(vertices_y))
    # Floating-point numbers: from a point between three vertices of Y. (Texture
    # coordinates with seams, which corners have, not vertices: transfer_texture.)
    uv_x = result.transfer(unwrap(vertices_y))

    write_ply(output, vertices_x, faces_x, colors_x, uv_x)
    print(f"{output}: {len(vertices_x)} vertices with the colors of {y_path}")


if __name__ == "__main__":
    main()
