"""Start here, watch there, fetch elsewhere. In one terminal

    isomatch-server --data-dir jobs &
    python3 watch_from_another_process.py start a.off b.off

and in others, on any machine that reaches the server, now or tomorrow:

    python3 watch_from_another_process.py watch
    python3 watch_from_another_process.py fetch map.txt

ISOMATCH_SERVER=HOST:PORT names another server than 127.0.0.1:7443.
"""

import asyncio
import os
import sys

import numpy as np

import isomatch

LABELS = {"made-by": "watch_from_another_process"}


async def follow(job: isomatch.Job) -> None:
    async for status in job.progress():
        print(f"{job.name}  {status.state.value:9}  {status.total_fraction:4.0%}  {status.stage}")


async def follow_all(jobs: list[isomatch.Job]) -> None:
    await asyncio.gather(*(follow(job) for job in jobs))


def main() -> None:
    command, *arguments = sys.argv[1:]
    with isomatch.Client(os.environ.get("ISOMATCH_SERVER", "127.0.0.1:7443")) as client:
        if command == "start":
            x, y = arguments
            # The job goes on when we have gone.
            print(client.submit(x, y, labels=LABELS).name)
            return
        jobs = [client.job(status.name) for status in client.jobs(labels=LABELS)]
        if command == "watch":
            asyncio.run(follow_all(jobs))
        elif command == "fetch":
            result = jobs[0].result()  # the newest; waits if it runs
            np.savetxt(arguments[0], result.y_from_x, fmt="%d")
            print(f"{result.job}: {len(result.y_from_x)} vertices")


if __name__ == "__main__":
    main()
