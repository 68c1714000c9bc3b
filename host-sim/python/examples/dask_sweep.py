"""A sweep in parts on the workers of Dask, and the parts put together.

    pip install arso distributed
    python dask_sweep.py ../../sweeps/wide.toml wide.parquet            # two workers here
    python dask_sweep.py wide.toml wide.parquet tcp://scheduler:8786    # a cluster

All workers must see the folder of the output and of the sweep file. Each part is one task; a part whose worker dies is
made anew by another one. The file is the same, to the byte, as one machine writes it.
"""

import sys
from pathlib import Path

import arso
from dask.distributed import Client

PARTS = 10


def part(description, out, number):
    """Makes one part; its file."""
    path = Path(out).with_suffix(f".{number}-of-{PARTS}.parquet")
    arso.sweep(description, path, shard=f"{number}/{PARTS}")
    return path


def main(description, out, scheduler=None):
    workers = {} if scheduler else {"n_workers": 2, "threads_per_worker": 1}
    with Client(scheduler, **workers) as client:
        description, out = Path(description).resolve(), Path(out).resolve()
        tasks = client.map(part, *zip(*[(description, out, i) for i in range(1, PARTS + 1)]), pure=False)
        summary = arso.merge_sweep(out, client.gather(tasks))
    for law in summary["laws"]:
        print(law["law"], law["settling_time"], f"{law['not_settled']} of {summary['samples']} not settled")


if __name__ == "__main__":
    main(*sys.argv[1:])
