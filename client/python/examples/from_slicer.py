"""For who comes from 3D Slicer: from_slicer.py TEMPLATE SCAN POINTS.mrk.json OUT.mrk.json

POINTS are landmarks of the template, as Slicer's Markups module saves them; OUT gets
them on the scan, under their names, for Slicer to load. Meshes and points have to be in
one coordinate system, as Slicer saves both (LPS).

Inside Slicer, `slicer.util.arrayFromModelPoints` and the polygons of the model's
PolyData are (vertices, faces) for isomatch.match; PythonSlicer -m pip installs the wheel.
"""

import json
import sys

import numpy as np

import isomatch


def read_points(path: str) -> tuple[dict, np.ndarray]:
    """The document, and the n x 3 positions in it."""
    with open(path, encoding="utf-8") as file:
        document = json.load(file)
    points = document["markups"][0]["controlPoints"]
    return document, np.array([point["position"] for point in points], dtype=float)


def main() -> None:
    template, scan, points, output = sys.argv[1:]
    document, positions = read_points(points)
    vertices, faces = isomatch.read_mesh(template)
    places_on_scan, _ = isomatch.read_mesh(scan)
    result = isomatch.match((vertices, faces), scan)
    print(f"verdict: {result.verdict}")

    # Each point to the nearest vertex of the template, and from there onto the scan.
    distances = np.linalg.norm(vertices[None] - positions[:, None], axis=2)
    nearest = distances.argmin(axis=1)
    carried = result.transfer(places_on_scan, missing=np.nan)[nearest]
    for point, place, vertex in zip(document["markups"][0]["controlPoints"], carried, nearest):
        point["position"] = place.tolist()
        confidence = 0.0 if result.confidence is None else result.confidence[vertex]
        print(f"{point['label']:12} {np.round(place, 3)}  confidence {confidence:.2f}")
    with open(output, "w", encoding="utf-8") as file:
        json.dump(document, file, indent=2)


if __name__ == "__main__":
    main()
