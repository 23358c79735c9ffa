"""Known matches help where the shapes alone do not decide: landmarks.py X Y PAIRS

PAIRS has lines `x y`, 0-based vertices of X and Y that belong together. A landmark
that the rest of the map contradicts is changed, and we say so;
landmarks_exact=True would keep it.
"""

import sys

import numpy as np

import isomatch


def main() -> None:
    x, y, pairs = sys.argv[1:]
    landmarks = np.loadtxt(pairs, dtype=int, ndmin=2)
    try:
        result = isomatch.match(x, y, landmarks=landmarks)
    except isomatch.InvalidInput as error:
        # "landmarks[3].y: is 9999, expected an integer, 0 to 1999", for one;
        # error.field is then "landmarks[3].y".
        sys.exit(f"{pairs}: {error}")
    for outcome in result.info.landmarks:
        if outcome.kept:
            print(f"{outcome.x} -> {outcome.y}: kept")
        else:
            print(
                f"{outcome.x} -> {outcome.y}: contradicted, the map says "
                f"{outcome.y_found} ({outcome.distance:.3f} away)"
            )


if __name__ == "__main__":
    main()
