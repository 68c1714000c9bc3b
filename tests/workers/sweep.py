"""A sweep on two workers of HyperQueue, one of them killed in the middle: the same bytes as on one machine.

    python tests/workers/sweep.py HOST_SIM

The package of PyPI brings server and workers, but not the program `hq` that starts them one by one; so each worker
here is a process of its own, which begins a server like any other program of the package, and then joins ours.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hyperqueue.cluster import LocalCluster, WorkerConfig

SPREAD = Path(__file__).resolve().parents[2] / "host-sim/sweeps/on-hyperqueue.py"
SHARDS = 6
SAMPLES = 1200
PATIENCE = 60.0  # s
# Where a server says how it is reached, for those who join it.
ACCESS = "hq-current"

DRIVE = """
[actuator]
mass = 0.5
force_constant = 5.0
current_limit = 2.0
[encoder]
resolution = 1e-5
counter_bits = 16
[[load]]
mass = 0.3
stiffness = 40.0
damping = 0.2
[control]
sample_time = 10e-3
disturbance_cutoff = 60.0
reaction_force_cutoff = 60.0
observer = "anchored"
[cost]
current = 1.0
position = [20.0, 20.0]
velocity = [1.0, 1.0]
[move]
velocity = 0.1
table = 2000
"""

SWEEP = f"""
seed = 5
samples = {SAMPLES}
drive = "drive.toml"
step = 0.03
duration = 4.0
laws = ["drive", "full state"]
[vary]
"plant.load.*.stiffness" = {{ uniform = [0.7, 1.3], relative = true }}
"plant.friction.coulomb" = {{ uniform = [0.0, 0.05] }}
"""


def work(own, server):
    """Is a worker with one core, until it is killed."""
    cluster = LocalCluster(server_dir=own)
    access = Path(own, ACCESS)
    access.unlink()
    access.symlink_to(Path(server, ACCESS).resolve())
    cluster.start_worker(WorkerConfig(cores=1))
    signal.pause()


def begun(parts):
    """Parts of which something is kept, and that are not whole."""
    return {chunk.parent for chunk in Path(parts).glob("*.parquet.parts/[0-9]*.parquet")}


def main(program):
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "drive.toml").write_text(DRIVE)
        (place / "sweep.toml").write_text(SWEEP)
        sweep, whole, out = place / "sweep.toml", place / "whole.parquet", place / "out.parquet"
        began = time.monotonic()
        alone = [program, "sweep", "--quiet", str(sweep), "--out", str(whole)]
        subprocess.run(alone, check=True, env={**os.environ, "RAYON_NUM_THREADS": "1"})
        alone = time.monotonic() - began

        server = place / "server"
        server.mkdir()
        workers = []
        try:
            with LocalCluster(server_dir=str(server)):
                for number in (1, 2):
                    own = place / f"worker-{number}"
                    own.mkdir()
                    command = [sys.executable, __file__, "--worker", str(own), str(server)]
                    workers.append(subprocess.Popen(command, stdout=subprocess.DEVNULL))
                began = time.monotonic()
                command = [sys.executable, str(SPREAD), str(sweep), str(out), "--shards", str(SHARDS)]
                command += ["--server", str(server), "--host-sim", program]
                spread = subprocess.Popen(command, stderr=subprocess.DEVNULL)
                # Both are at work, and have kept something.
                while len(begun(f"{out}.shards")) < 2:
                    assert time.monotonic() - began < PATIENCE, "the workers do not work"
                    assert spread.poll() is None, "it ended before a worker could be killed"
                    time.sleep(0.005)
                workers[0].send_signal(signal.SIGKILL)
                killed = time.monotonic() - began
                assert not out.exists()
                assert spread.wait(PATIENCE) == 0, "it was not made on the workers"
                spread = time.monotonic() - began
        finally:
            for worker in workers:
                worker.kill()
                worker.wait()
        assert out.read_bytes() == whole.read_bytes(), "the workers made another file"
        assert not Path(f"{out}.shards").exists()
        print(
            f"sweep of {SAMPLES} samples on two workers of one core, one killed after {killed:.1f} s: the same "
            f"{whole.stat().st_size} bytes after {spread:.1f} s as one core alone after {alone:.1f} s"
        )


if __name__ == "__main__":
    if sys.argv[1] == "--worker":
        work(*sys.argv[2:4])
    else:
        main(str(Path(sys.argv[1]).resolve()))
