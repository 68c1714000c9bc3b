"""Tests `host-sim identify` with the logs of an independent simulator.

Each drive is known roughly: masses within 20 %, stiffness within a factor of 0.6 to 1.6, damping
within 0.3 to 3, friction not at all; its force constant, which sets the scale, exactly. `host-sim
excite` forms a current from that rough description, the simulator applies it to the true drive, and
`host-sim identify` must find the true drive in the log. The simulator is exact: linear motion by
matrix exponentials, Coulomb friction by solving for each instant at which the actuator stops or
breaks loose. Amplifier noise, encoder noise, quantisation and the wrapping counter are real.

usage: identification.py [--only NAME] [--keep DIR] [--own-excitation] HOST_SIM
       identification.py --logs DIR [--only NAME] (--own-excitation | HOST_SIM)
"""

import argparse
import copy
import json
import subprocess
import tempfile
import time
import tomllib
import zlib
from dataclasses import dataclass
from functools import partial, reduce
from itertools import cycle
from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

AMPLIFIER_NOISE = 5e-4  # of the current limit, standard deviation per sample
ENCODER_NOISE = 0.7  # counts, standard deviation before rounding
# What identification must reach: relative errors, and standard deviations.
STIFF, DISSIPATION, SIGMAS = 0.02, 0.15, 3.0
# Coulomb friction below this part of the peak force need only be within its own interval.
PERCEPTIBLE = 0.01
TERMS = 17  # of an exponential's series within a control period: the last is 1e-20 of the first
TIMEOUT = 300  # s, for each call of the program

# Masses, actuator first, kg; stiffness, N/m, and ratio of each damper with the mass behind it, %;
# force constant, N/A, and current limit, A; Coulomb friction, % of the peak force, and viscous,
# N s/m; encoder, m per count (c/20000: rotary, 20000 counts per turn), and bits of its counter;
# samples per period of the fastest mode, or sample time, s.
DRIVES = """
paper       | .059 .019 .019 .019| 300              | 2.094     | 6.43 2| 2 .2  | 1e-6 16   | 1e-3
paper-smooth| .059 .019 .019 .019| 300              | 2.094     | 6.43 2| 0 0   | 1e-6 16   | 1e-3
heavy       | .05 .1 .1 .1       | 1e3              | 2.5       | 6.43 2| 1.5 .1| 1e-6 16   | 30
stiff       | .5 1               | 1e5              | .5        | 30 5  | 3 5   | 1e-7 32   | 20
soft        | .3 .2              | 50               | 2         | 10 1  | 1 .3  | 5e-6 16   | 40
light-load  | 1 .2               | 2e4              | 1         | 20 4  | 5 2   | 1e-6 16   | 30
uneven-two  | .4 .15 .6          | 2e4 4e3          | 1 .4      | 20 4  | 4 1   | 1e-6 16   | 25
undamped    | .2 .04 .1          | 1.5e3 3e3        | .3 .3     | 8 2   | 0 .2  | 1e-6 16   | 20
outweighed  | .15 .75 .3         | 8e3 1.2e4        | .6 1      | 12 3  | 1 .5  | 1e-7 32   | 25
uneven-three| .1 .3 .05 .15      | 5e3 8e3 2e3      | 1 2 .5    | 8 3   | 2.5 .3| 1e-6 32   | 25
four        | .25 .1 .1 .05 .08  | 3e3 1.5e3 2e3 1e3| 1 1.5 .8 2| 10 3  | 1.5 .4| 1e-6 16   | 25
coarse      | .5 .3 .4           | 600 400          | 1 2       | 10 3  | 2 1   | 5e-6 16   | 25
rotary      | 1e-4 2e-4 5e-5     | 20 8             | 1 1.5     | .1 5  | 2 2e-4| c/20000 16| 35
rotary-fine | 1e-4 4e-4          | 200              | .4        | .08 6 | 3 1e-4| c/1e6 32  | 25
"""


def drive(masses, springs, ratios, motor, friction, encoder, pace):
    """A drive as its file has it, from the columns of its row."""
    numbers = ([float(x) for x in c.split()] for c in (masses, springs, ratios, motor, friction))
    masses, springs, ratios, (force_constant, limit), (coulomb, viscous) = numbers
    true = {"kind": "rotary" if "c/" in encoder else "linear"}
    true["actuator"] = {"mass": masses[0], "force_constant": force_constant}
    true["actuator"] |= {"current_limit": limit, "current_resolution": limit / 2000}
    resolution, bits = encoder.replace("c/", "").split()
    resolution = 2 * np.pi / float(resolution) if "c/" in encoder else float(resolution)
    true["encoder"] = {"resolution": resolution, "counter_bits": int(bits)}
    true["load"] = [
        {"mass": m, "stiffness": k, "damping": float(f"{2 * r / 100 * np.sqrt(k * m):.3g}")}
        for m, k, r in zip(masses[1:], cycle(springs), cycle(ratios))
    ]
    true["friction"] = {"coulomb": coulomb * force_constant * limit / 100, "viscous": viscous}
    frequency, t = modes(true), float(pace)
    t = t if t < 1.0 else float(f"{2 * np.pi / frequency[-1] / t:.2g}")
    true["control"] = {"sample_time": t, "observer": "anchored"}
    true["control"] |= dict.fromkeys(("disturbance_cutoff", "reaction_force_cutoff"), 0.6 / t)
    # The rigid motion a quarter as fast as the slowest mode.
    weight = ((frequency[0] / 4) ** 2 * sum(masses) / force_constant) ** 2 / len(masses)
    true["cost"] = {"current": 1.0, "position": [weight] * len(masses)}
    true["cost"]["velocity"] = [5 * weight / frequency[0] ** 2] * len(masses)
    return true


def system(true):
    """Masses, and A of the chain with its viscous friction; order x_a v_a x_1 v_1 ..."""
    loads = true["load"]
    mass = np.array([true["actuator"]["mass"], *(load["mass"] for load in loads)])
    n = len(mass)
    # Column j: what spring j does to the masses, pulling and pulled.
    pairs = (np.eye(n) - np.eye(n, k=-1))[:, : n - 1]
    keys = "stiffness", "damping"
    stiffness, damping = (pairs * [load[key] for load in loads] @ pairs.T for key in keys)
    damping[0, 0] += true.get("friction", {}).get("viscous", 0.0)
    a = np.zeros((2 * n, 2 * n))
    a[0::2, 1::2] = np.eye(n)
    a[1::2, 0::2] = -stiffness / mass[:, None]
    a[1::2, 1::2] = -damping / mass[:, None]
    return mass, a


def modes(true):
    """Undamped frequencies, rad/s, ascending, without the rigid motion."""
    _, a = system(true)
    return np.sqrt(np.sort(-np.linalg.eigvals(a[1::2, 0::2]).real)[1:])


def roots(polynomial, end):
    """All places in (0, end), end <= 1, where a polynomial (constant first) changes its sign.

    Between those of its derivative it is monotone, so that none can hide.
    """
    if np.abs(polynomial[1:]).sum() < abs(polynomial[0]) or len(polynomial) < 2:
        return []
    edges = [0.0, *roots(polynomial[1:] * np.arange(1, len(polynomial)), end), end]
    downwards = polynomial[::-1].tolist()

    def value(s):
        return reduce(lambda total, coefficient: total * s + coefficient, downwards)

    pieces = zip(edges, edges[1:])
    return [brentq(value, a, b, xtol=1e-13) for a, b in pieces if value(a) * value(b) < 0]


class Plant:
    """The true drive, exact from one instant at which the actuator stops or gets loose to the next.

    In between, the force on the actuator is constant: of the motor, less Coulomb friction while
    the actuator slips. It extends the state.
    """

    def __init__(self, true):
        mass, a = system(true)
        self.coulomb, step = true["friction"]["coulomb"], true["control"]["sample_time"]
        n = len(a)
        slip = np.zeros((n + 1, n + 1))
        slip[:n, :n], slip[1, n] = a, 1.0 / mass[0]
        stick = slip.copy()
        stick[1] = 0.0
        # Over a period; and the terms of the exponential's series in parts of a period.
        self.period = [expm(matrix * step) for matrix in (slip, stick)]
        self.series = np.empty((2, TERMS, n + 1, n + 1))
        for series, matrix in zip(self.series, (slip, stick)):
            series[0] = np.eye(n + 1)
            for k in range(1, TERMS):
                series[k] = series[k - 1] @ matrix * (step / k)
        # Of the actuator's velocity while it slips, of the force on it while it sticks.
        self.velocity = self.series[0, :, 1]
        self.load = mass[0] * slip[1] @ self.series[1]
        self.state = np.zeros(n)

    def advance(self, force):
        """One control period under a constant force of the motor."""
        done = 0.0
        while done < 1.0:
            z, left = np.append(self.state, force), 1.0 - done
            load = self.load @ z
            loose = np.sign(load[0]) * (abs(load[0]) > self.coulomb)
            sign = np.sign(self.state[1]) or loose
            if sign:
                z[-1] -= sign * self.coulomb
                velocity = self.velocity @ z
                # From rest: the start itself is no end.
                ends = roots(velocity[int(velocity[0] == 0.0) :], left)
            else:
                limits = (load - np.eye(1, TERMS)[0] * side * self.coulomb for side in (1.0, -1.0))
                # A little beyond the limit, so that it is loose there.
                ends = [at + 1e-9 for limit in limits for at in roots(limit, left)]
            part, mode = min([left, *ends]), int(not sign)
            if part < 1.0:
                z = np.tensordot(part ** np.arange(TERMS), self.series[mode], 1) @ z
            else:
                z = self.period[mode] @ z
            self.state = z[:-1]
            if mode or part in ends:
                self.state[1] = 0.0
            done += part


def simulate(true, current, rng):
    """Counts at every instant, and the current applied before it as the drive knows it."""
    actuator, encoder = true["actuator"], true["encoder"]
    resolution = actuator["current_resolution"]
    known = np.round(np.asarray(current) / resolution) * resolution
    real = known + AMPLIFIER_NOISE * actuator["current_limit"] * rng.standard_normal(len(known))
    plant = Plant(true)
    position = np.zeros(len(known) + 1)
    for k, value in enumerate(real):
        plant.advance(actuator["force_constant"] * value)
        position[k + 1] = plant.state[0]
    exact = position / encoder["resolution"] + ENCODER_NOISE * rng.standard_normal(len(position))
    span = 2 ** encoder["counter_bits"]
    start = int(rng.integers(span))
    return (np.round(exact).astype(np.int64) + start) % span, np.append(0.0, known)


def roughly(true, rng):
    """What its user knows of a drive."""
    rough = copy.deepcopy(true)
    del rough["friction"]
    rough["actuator"]["mass"] *= rng.uniform(0.8, 1.2)
    for load in rough["load"]:
        load["mass"] *= rng.uniform(0.8, 1.2)
        load["stiffness"] *= np.exp(rng.uniform(np.log(0.6), np.log(1.6)))
        load["damping"] *= np.exp(rng.uniform(np.log(0.3), np.log(3.0)))
    return rough


def multisine(t, lowest, highest, peak, period=2.0, repeats=4):
    """Schroeder's multisine between frequencies in Hz, begun where it makes no mean velocity."""
    n = round(max(period, 1 / lowest) / t)
    lines = np.arange(np.ceil(lowest * n * t - 1e-9), highest * n * t)
    phase = -np.pi * np.arange(len(lines)) * np.arange(1, len(lines) + 1) / len(lines)
    current = np.cos(2 * np.pi * np.outer(np.arange(n) / n, lines) + phase).sum(axis=1)
    before = np.cumsum(current) - current
    current = np.roll(current, -np.argmin(np.abs(before - before.mean())))
    return np.tile(peak * current / np.abs(current).max(), repeats)


def own_excitation(rough, _):
    """The multisine for a rough drive: all its modes, and as much below and above."""
    frequency = modes(rough) / (2 * np.pi)
    band = 0.2 * frequency[0], 1.5 * frequency[-1]
    return multisine(rough["control"]["sample_time"], *band, rough["actuator"]["current_limit"] / 2)


def toml(drive):
    """The drive as a file."""
    kind, *tables = drive.items()
    lines = ['{} = "{}"'.format(*kind)]
    for name, table in tables:
        for entry in table if isinstance(table, list) else [table]:
            lines.append(f"[[{name}]]" if isinstance(table, list) else f"[{name}]")
            lines += [f"{key} = {json.dumps(value)}" for key, value in entry.items()]
    return "\n".join(lines) + "\n"


def parameters(drive):
    """All that can be identified, by the names that the program gives it."""
    result = {f"actuator.{key}": drive["actuator"][key] for key in ("mass", "force_constant")}
    for j, load in enumerate(drive["load"], 1):
        result |= {f"load[{j}].{key}": value for key, value in load.items()}
    return result | {f"friction.{key}": value for key, value in drive.get("friction", {}).items()}


def run(host_sim, *arguments):
    """What the program prints."""
    command = [host_sim, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    if done.returncode:
        raise RuntimeError(f"{arguments[0]} fails: {done.stderr.strip()}")
    return done.stdout


def proposed(host_sim, rough, path):
    """The current that the program proposes for a rough drive."""
    header, *rows = run(host_sim, "excite", path, "--csv").splitlines()
    t, current = np.array([row.split(",") for row in rows], dtype=float).T
    late = t / rough["control"]["sample_time"] - np.arange(len(t))
    if header != "time[s],current[A]" or np.abs(late).max() > 1e-3:
        raise RuntimeError("excite does not print a current for every control period")
    if np.abs(current).max() > rough["actuator"]["current_limit"]:
        raise RuntimeError("excite exceeds the current limit")
    return current


@dataclass
class Case:
    """One log, and how the program is to read it."""

    name: str
    true: dict
    rough: dict
    current: np.ndarray | None = None  # that of the excitation if None
    kind: str = "excitation"
    hold: str = "actuator.force_constant"

    def write(self, directory, excite):
        """Makes the log, and describes the drive roughly and truly."""
        log, rough, true = self.files(directory, "csv", "rough.toml", "true.toml")
        rough.write_text(toml(self.rough))
        true.write_text(toml(self.true))
        plant = self.true | ({"load": []} if self.kind == "free" else {})
        current = excite(self.rough, rough) if self.current is None else self.current
        rng = np.random.default_rng(zlib.crc32(self.name.encode()))
        counts, known = simulate(plant, current, rng)
        t = self.true["control"]["sample_time"]
        rows = enumerate(zip(counts.tolist(), known.tolist()))
        text = "".join(f"{k * t},{count},{i}\n" for k, (count, i) in rows)
        log.write_text("time[s],count[1],applied_current[A]\n" + text)

    def files(self, directory, *endings):
        """Where this case is kept."""
        return [directory / f"{self.name}.{ending}" for ending in endings]

    def tolerance(self, name):
        """Largest relative error allowed; infinite where only the interval counts."""
        actuator, coulomb = self.true["actuator"], self.true["friction"]["coulomb"]
        slight = coulomb < PERCEPTIBLE * actuator["force_constant"] * actuator["current_limit"]
        vague = {"friction.viscous": self.kind == "excitation", "friction.coulomb": slight}
        if vague.get(name):
            return np.inf
        return DISSIPATION if "friction" in name or "damping" in name else STIFF

    def judge(self, found, written):
        """Errors relative to the true values, and over their standard deviations; what is wrong."""
        true, rough = parameters(self.true), parameters(self.rough)
        if self.kind != "excitation":
            true = {name: value for name, value in true.items() if "load" not in name}
        if found.keys() != true.keys():
            return {}, {}, [f"it identifies {', '.join(found)} instead of {', '.join(true)}"]
        faults, errors, sigmas = [], {}, {}
        for name, expected in true.items():
            value, std, held = (found[name][key] for key in ("value", "std", "held"))
            if not abs(written.get(name, np.inf) - value) <= 1e-6 * abs(value):
                faults.append(f"{name} is {value:.6g}, in the drive file {written.get(name)}")
            if held != (name == self.hold) or (held and value != rough[name]):
                faults.append(f"{name} is {value}, held {held}: {self.hold} was to be held")
            if held:
                continue
            if self.kind == "slow" and name == "actuator.mass":
                # Found is the mass of all, less that of the loads as the rough drive has them.
                value += sum(load["mass"] for load in self.rough["load"])
                expected += sum(load["mass"] for load in self.true["load"])
            error = abs(value - expected)
            errors[name] = error / expected if expected else 0.0
            sigmas[name] = error / std if std else np.inf
            if not (errors[name] <= self.tolerance(name) and sigmas[name] <= SIGMAS):
                off = f"{errors[name]:.2%} or {sigmas[name]:.1f} standard deviations"
                faults.append(f"{name} is {value:.5g}, {off} from {expected:.5g}")
        return errors, sigmas, faults

    def test(self, host_sim, directory, excite):
        """Prints the row of the table and what is wrong; returns whether anything is."""
        log, rough, drive = self.files(directory, "csv", "rough.toml", "identified.toml")
        faults = []
        try:
            self.write(directory, excite)
            start = time.monotonic()
            options = ["--drive", rough, "--run", self.kind, "--hold", self.hold, "--toml", drive]
            found = json.loads(run(host_sim, "identify", log, "--json", *options))
            seconds = time.monotonic() - start
            written = parameters(tomllib.loads(drive.read_text()))
            errors, sigmas, faults = self.judge(found["parameters"], written)
            damping = max([0.0, *(e for name, e in errors.items() if "damping" in name)])
            stiff = max([0.0, *(e for name, e in errors.items() if self.tolerance(name) == STIFF)])
            row = f"{stiff:9.3%} {damping:8.2%} {max([0.0, *sigmas.values()]):12.2f}"
            print(f"{self.name:12} {row} {found['fit_percent']:8.3f} {seconds:7.1f}", flush=True)
            run(host_sim, "design", drive)
        except (RuntimeError, ValueError, KeyError, subprocess.TimeoutExpired) as error:
            faults.append(f"{type(error).__name__}: {error}")
        for fault in faults:
            print(f"{self.name}: {fault}", flush=True)
        return bool(faults)


def cases():
    """All logs: each drive excited; the paper's also with its load detached, and slow."""
    for row in DRIVES.strip().splitlines():
        name, *columns = (column.strip() for column in row.split("|"))
        true = drive(*columns)
        rough = roughly(true, np.random.default_rng(zlib.crc32(f"{name} roughly".encode())))
        yield Case(name, true, rough)
        if name != "paper":
            continue
        t, limit = true["control"]["sample_time"], true["actuator"]["current_limit"]
        free = multisine(t, 2.0, 25.0, 0.4 * limit)
        yield Case("free", true, rough, free, "free")
        # The force constant instead, of an actuator that has been weighed.
        weighed = copy.deepcopy(rough)
        weighed["actuator"]["mass"] = true["actuator"]["mass"]
        weighed["actuator"]["force_constant"] *= 1.15
        yield Case("free-weighed", true, weighed, free, "free", "actuator.mass")
        # 1 Hz that swells and fades, far below the slowest mode.
        phase = 2 * np.pi * np.arange(round(8.0 / t)) * t
        slow = 0.12 * limit * (1.0 + 0.4 * np.sin(phase / 4)) * np.cos(phase)
        yield Case("slow", true, rough, slow, "slow")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("host_sim", nargs="?", help="the program to be tested")
    parser.add_argument("--own-excitation", action="store_true", help="not that of the program")
    parser.add_argument("--only", metavar="NAME", action="append", help="this case alone")
    parser.add_argument("--keep", metavar="DIR", type=Path, help="keep all files here")
    parser.add_argument("--logs", metavar="DIR", type=Path, help="write logs and drives, no more")
    options = parser.parse_args()
    host_sim = options.host_sim
    if not host_sim and not (options.logs and options.own_excitation):
        parser.error("HOST_SIM is needed for all but --logs with --own-excitation")
    excite = own_excitation if options.own_excitation else partial(proposed, host_sim)
    chosen = [case for case in cases() if case.name in (options.only or [case.name])]
    if not chosen:
        parser.error(f"no case is named {' or '.join(options.only)}")
    with tempfile.TemporaryDirectory() as scratch:
        directory = options.logs or options.keep or Path(scratch)
        directory.mkdir(parents=True, exist_ok=True)
        if options.logs:
            for case in chosen:
                case.write(directory, excite)
            return
        print("worst of     mass, spring damping  error / std  fit [%]       s")
        failed = [case.name for case in chosen if case.test(host_sim, directory, excite)]
    if failed:
        raise SystemExit(f"{len(failed)} of {len(chosen)} cases failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
