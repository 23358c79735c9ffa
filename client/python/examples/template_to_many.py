"""One template against many meshes: template_to_many.py TEMPLATE FOLDER MESH...

Writes FOLDER/NAME.npy for each mesh NAME.off: its vertex for each vertex of the
template. All jobs are started at once and wait in the server's queue; the
template travels once, and the server prepares it once.
"""

import pathlib
import sys

import numpy as np

import isomatch


def save(job: isomatch.Job, output: pathlib.Path) -> None:
    result = job.result()
    np.save(output, result.y_from_x)
    distortion = result.info.quality.geodesic_distortion
    print(f"{output.stem:20} distortion {distortion:.3f}, {result.info.run_seconds:.1f} s")


def main() -> None:
    template, folder, *paths = sys.argv[1:]
    jobs: dict[pathlib.Path, isomatch.Job] = {}
    failed = 0
    with isomatch.Client() as client:
        uploaded = client.upload(template)
        for path in map(pathlib.Path, paths):
            try:
                jobs[path] = client.submit(uploaded, path, labels={"mesh": path.stem})
            except isomatch.InvalidInput as error:
                failed += 1
                print(f"{path.stem:20} refused: {error}")
        for path, job in jobs.items():
            try:
                save(job, pathlib.Path(folder) / f"{path.stem}.npy")
            except isomatch.IsomatchError as error:
                failed += 1
                print(f"{path.stem:20} failed: {error}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
