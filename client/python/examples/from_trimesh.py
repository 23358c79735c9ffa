"""For who comes from trimesh: from_trimesh.py X Y OUT.ply

Meshes of trimesh are taken as they are. process=False keeps the file's vertices:
otherwise trimesh joins some, and the map is in other numbers than the file.
trimesh.registration needs a near start and keeps the shape rigid; this does neither.
"""

import sys
from typing import Any

import isomatch


def color_by_place(vertices: Any) -> Any:
    """Red, green and blue by x, y and z."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return (255 * (vertices - low) / (high - low)).astype("uint8")


def main() -> None:
    import trimesh

    x_path, y_path, output = sys.argv[1:]
    x = trimesh.load(x_path, process=False)
    y = trimesh.load(y_path, process=False)
    result = isomatch.match(x, y)
    print(f"verdict: {result.verdict}")
    if not result.matched.all():
        print(f"{(~result.matched).sum()} vertices of X are on no face")

    # X in the shape of Y: the same vertices and faces, in the places of their images.
    fitted = trimesh.Trimesh(result.transfer(y.vertices), x.faces, process=False)
    fitted.visual.vertex_colors = result.transfer(color_by_place(y.vertices))
    fitted.export(output)
    print(f"{output}: {len(fitted.vertices)} vertices of X where they lie on Y")


if __name__ == "__main__":
    main()
