"""Two files in, the map out: match_two_files.py X Y MAP

    isomatch sample --pose A --vertices 2000 -o a.off
    isomatch sample --pose B --vertices 2000 -o b.off
    python3 match_two_files.py a.off b.off map.txt

The work is done in this process; give match server="HOST:PORT" to have it done there.
"""

import sys

import numpy as np

import isomatch


def show(status: isomatch.JobStatus) -> None:
    print(f"{status.total_fraction:4.0%}  {status.stage}", file=sys.stderr)


def main() -> None:
    x, y, output = sys.argv[1:]
    result = isomatch.match(x, y, on_progress=show)
    # Line i: the vertex of Y for vertex i of X, as `isomatch match` writes it.
    np.savetxt(output, result.y_from_x, fmt="%d")
    quality = result.info.quality
    print(f"verdict: {result.verdict}")
    print(f"{result.matched.sum()} of {len(result.y_from_x)} vertices matched")
    print(f"geodesic distortion {quality.geodesic_distortion:.3f}, coverage {quality.coverage:.0%}")
    assert result.confidence is not None
    print("least trusted vertices of X:", np.argsort(result.confidence)[:5])


if __name__ == "__main__":
    main()
