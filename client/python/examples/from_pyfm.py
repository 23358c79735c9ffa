"""For who comes from pyFM: from_pyfm.py X Y

There, one loads two TriMesh, computes eigenvectors and descriptors, fits a functional
map, refines it by ZoomOut and converts it to a vertex map. Here one call does all of it,
and near-symmetric shapes do not flip. What pyFM calls p2p_21 of (mesh1, mesh2) is
y_from_x of (X=mesh2, Y=mesh1); its FM_12 is fmap_x_from_y.
"""

import sys

import numpy as np

import isomatch


def main() -> None:
    x, y = sys.argv[1:]
    result = isomatch.match(x, y)
    print(f"verdict: {result.verdict}")

    # The vertex map: for each vertex of X one of Y.
    p2p_21 = result.y_from_x
    print(f"p2p_21: {p2p_21.shape[0]} vertices of X, first {p2p_21[:5]}")

    # The functional map of the first 30 eigenfunctions; columns are those of Y.
    functional = result.functional_map(30)
    fm_12 = functional.fmap_x_from_y
    off_diagonal = np.abs(fm_12 - np.diag(np.diag(fm_12))).sum() / np.abs(fm_12).sum()
    print(f"FM_12: {fm_12.shape}, {off_diagonal:.0%} of it off the diagonal")

    # Functions are carried by coefficients, or as values of vertices.
    coefficients_y = np.zeros(30)
    coefficients_y[1] = 1
    print("the second eigenfunction of Y on X:", np.round(fm_12 @ coefficients_y, 2)[:5])
    places, _ = isomatch.read_mesh(y)
    print("the coordinates of Y on X:", result.transfer(places).shape)


if __name__ == "__main__":
    main()
