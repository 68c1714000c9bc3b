"""How fast `arso.simulate` is beside the same linear loop in numpy: control periods a second.

usage: python host-sim/python/tests/speed.py
"""

import time

import arso
import numpy as np
from conftest import fine
from test_simulate import linear_drive, sampled

WATCHED = 3.0


def fastest(work, times=5):
    """Seconds of the fastest run: what else the machine does only adds."""
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return min(taken)


def full_state(design, periods):
    (ad, bd), x, target = sampled(design), np.zeros(8), np.tile([2e-3, 0.0], 4)
    states = np.empty((periods, 8))
    for i in range(periods):
        states[i] = x
        x = ad @ x + bd * np.clip(-design.k @ (x - target), -2.0, 2.0)


def main():
    drive = arso.Drive()
    design = arso.design(arso.Drive.from_dict(fine(drive.to_dict())))
    arso.simulate(design, step=2e-3)
    periods = 2000
    # The loop runs on after the experiment, for the figures at its end.
    simulated = round((1.2 + WATCHED) / design.sample_time)
    for law, loop in [
        ("core", lambda: linear_drive(design, 2e-3, periods)),
        ("full_state", lambda: full_state(design, periods)),
    ]:
        here = fastest(lambda: arso.simulate(design, step=2e-3, law=law)) / simulated
        there = fastest(loop) / periods
        print(
            f"{law}: {1 / here:.3g} periods/s ({design.sample_time / here:.0f} times real time), "
            f"numpy {1 / there:.3g} periods/s: {there / here:.1f} times as fast"
        )


if __name__ == "__main__":
    main()
