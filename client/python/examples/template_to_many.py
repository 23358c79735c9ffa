"""One template against many meshes: template_to_many.py TEMPLATE FOLDER MESH...

Writes FOLDER/NAME.npy for each mesh NAME.off: its vertex for each vertex of the
template, which is prepared once; and FOLDER/NAME.ply, the template laid on the mesh:
all these have the same vertices and faces, as shape models need them.
"""

import pathlib
import sys

import numpy as np

import isomatch


def lay_template(result: isomatch.MatchResult, path: pathlib.Path) -> np.ndarray:
    """Where on the mesh each vertex of the template lies."""
    vertices, _ = isomatch.read_mesh(path)
    places: np.ndarray = result.transfer(vertices, missing=np.nan)
    return places


def write_ply(path: pathlib.Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    with open(path, "wb") as file:
        file.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
            "end_header\n".encode()
        )
        file.write(vertices.astype("<f4").tobytes() + rows.tobytes())


def main() -> None:
    template_path, folder, *paths = sys.argv[1:]
    template = isomatch.prepare(template_path)
    _, faces = isomatch.read_mesh(template_path)
    failed = 0
    for path in map(pathlib.Path, paths):
        try:
            result = isomatch.match(template, path)
        except (isomatch.IsomatchError, OSError) as error:
            failed += 1
            print(f"{path.stem:20} failed: {error}")
            continue
        output = pathlib.Path(folder) / path.stem
        np.save(output.with_suffix(".npy"), result.y_from_x)
        write_ply(output.with_suffix(".ply"), lay_template(result, path), faces)
        print(f"{path.stem:20} {result.verdict}, {result.info.run_seconds:.1f} s")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
