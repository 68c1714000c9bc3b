"""The closed loop of `host-sim` once more in plain numpy, to time it.

usage: loop_speed.py HOST_SIM [DRIVE.toml]

Matrices and gains come from `host-sim design --json`. A period is: encoder, the velocity and both force observers, the
state observer, feedback, current limit, and the exact plant; the reference steps by 30 mm. The core does more (moves,
protection, a record, hand-over between modes), so the ratio flatters numpy. Prints ns per period and times real time, and the
settling time as a check: `host-sim simulate fig3` has the same within a few periods. Time `cargo bench -p host-sim
--bench closed_loop` beside it on the same machine.
"""

import json
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
from scipy.linalg import expm

PERIODS = 20_000
PASSES = 5
STEP = 0.03  # m
BAND = 0.02


def main():
    host_sim, *drive_file = sys.argv[1:]
    command = [host_sim, "design", *drive_file, "--json", "--quiet"]
    design = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    default = Path(__file__).parents[2] / "host-sim" / "drive.toml"
    drive = tomllib.loads(Path(drive_file[0] if drive_file else default).read_text())
    least = min(timed(design, drive) for _ in range(PASSES))
    period = drive["control"]["sample_time"]
    truth, _ = run(design, drive, 1200)
    off = np.abs(truth[:, 2 * min(2, len(drive["load"]))] - STEP)
    outside = np.flatnonzero(~(off <= BAND * STEP))
    settled = period * (outside[-1] + 1) if len(outside) else 0.0
    print(f"numpy: {1e9 * least:.0f} ns/period, {period / least:.0f} x real time")
    print(f"settled after {1e3 * settled:.0f} ms")


def timed(design, drive):
    """Seconds per period."""
    begin = time.perf_counter()
    truth, currents = run(design, drive, PERIODS)
    figures(truth, currents)
    return (time.perf_counter() - begin) / PERIODS


def run(design, drive, periods):
    """True state and current of every period."""
    ad, bd, k = (np.array(design[key]) for key in ("ad", "bd", "k"))
    names = ("observer_transition", "observer_input", "observer_gain", "observer_output")
    transition, driven, correction, output = (np.array(design[name]) for name in names)
    control, actuator = drive["control"], drive["actuator"]
    t, limit, resolution = (
        control["sample_time"],
        actuator["current_limit"],
        drive["encoder"]["resolution"],
    )
    m, k_f = actuator["mass"], actuator["force_constant"]
    g_dist, g_reac = control["disturbance_cutoff"], control["reaction_force_cutoff"]
    a_dist, a_reac = np.exp(-g_dist * t), np.exp(-g_reac * t)
    lags = np.array([[-g_dist, 0.0, g_dist], [g_reac, -g_reac, 0.0], [0.0, 0.0, 0.0]])
    lags = expm(lags * t)[:2]
    loads = len(drive["load"])

    x, z, force = np.zeros(len(bd)), np.zeros(len(driven)), np.zeros(3)
    estimate, reference = np.zeros(len(bd)), np.zeros(len(bd))
    reference[::2] = STEP
    before = velocity = acceleration = current = 0.0
    truth, currents = np.empty((periods, len(bd))), np.empty(periods)
    for number in range(periods):
        truth[number] = x
        position = round(x[0] / resolution) * resolution
        raw = (position - before) / t
        velocity_before, velocity = velocity, a_dist * velocity + (1 - a_dist) * raw
        acceleration = a_reac * acceleration + (1 - a_reac) * (velocity - velocity_before) / t
        force[2] = k_f * current
        force[:2] = lags @ force
        reaction = force[1] - m * acceleration
        z = transition @ z + driven * raw
        z = z + correction * (reaction - output @ z)
        before = position
        estimate[0], estimate[1] = position, velocity
        estimate[2::2] = position + z[0 : 2 * loads : 2]
        estimate[3::2] = z[1 : 2 * loads : 2]
        current = -(k @ (estimate - reference)) + z[-1] / k_f
        current = min(max(current, -limit), limit)
        currents[number] = current
        x = ad @ x + bd * current
    return truth, currents


def figures(truth, currents):
    """What a run is judged by, as far as the state says it."""
    end = truth[len(truth) * 5 // 12 :]
    return (
        np.abs(currents).max(),
        np.ptp(end[:, ::2], axis=0),
        end[:, ::2].mean(axis=0),
        truth[:, ::2].max(axis=0),
    )


main()
