#!/usr/bin/env python3
"""Spreads a sweep over workers of HyperQueue, and puts the parts together when all are done.

    pip install hyperqueue
    python host-sim/sweeps/on-hyperqueue.py host-sim/sweeps/wide.toml wide.parquet --shards 16

Without --server the workers are the cores of this machine. With it they are those that have joined a running
server (`hq server start`, `hq worker start` or `hq alloc add slurm` on the nodes), and host-sim, the sweep file and
the folder of the output must be on a file system that all of them see. A worker that dies gives its parts back:
another one takes them up, where the chunks that were kept end.
"""

import argparse
import os
import shutil
import sys
from contextlib import ExitStack
from pathlib import Path

from hyperqueue import Client, Job
from hyperqueue.cluster import LocalCluster, WorkerConfig


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sweep", type=Path, help="description of the sweep")
    parser.add_argument("out", type=Path, help="Parquet file of the whole sweep")
    parser.add_argument("--shards", type=int, default=2 * os.cpu_count(), help="how many parts")
    parser.add_argument("--server", type=Path, help="folder of a running server, as `hq --server-dir` has it")
    parser.add_argument("--host-sim", default=shutil.which("host-sim"), help="the program")
    asked = parser.parse_args()
    if not asked.host_sim:
        parser.error("host-sim is not in the PATH: name it with --host-sim")
    if asked.shards < 1:
        parser.error("--shards: at least one")
    return asked


def main():
    asked = arguments()
    program, sweep, out = (str(Path(path).resolve()) for path in (asked.host_sim, asked.sweep, asked.out))
    parts = Path(out + ".shards")
    parts.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        if asked.server:
            client = Client(asked.server)
        else:
            cluster = stack.enter_context(LocalCluster())
            for _ in range(os.cpu_count()):
                cluster.start_worker(WorkerConfig(cores=1))
            client = cluster.client()
        job = Job(max_fails=0, name=Path(sweep).stem)
        # A worker is one core: so is a part of the sweep.
        one = {"RAYON_NUM_THREADS": "1"}
        tasks, files = [], []
        for number in range(1, asked.shards + 1):
            file = parts / f"{number}.parquet"
            shard = f"{number}/{asked.shards}"
            command = [program, "sweep", "--quiet", sweep, "--out", str(file), "--shard", shard]
            tasks.append(job.program(command, env=one, stdout=None, stderr=parts / f"{number}.stderr"))
            files.append(str(file))
        merge = [program, "sweep", "merge", "--quiet", out, *files]
        job.program(merge, deps=tasks, stdout=None, stderr=parts / "merge.stderr")
        client.wait_for_jobs([client.submit(job)])
    shutil.rmtree(parts)


if __name__ == "__main__":
    sys.exit(main())
