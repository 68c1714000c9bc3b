"""Compares `host-sim design --json` with scipy and python-control.

For the default drive and for random chains (1 to 6 loads, stiffness over four decades, damping
ratios down to 0.001): modes, system matrix, sampled model, gain, poles, observer gain, the gain over
the time to go, and the margins of full-state feedback and of the drive's own loop. Everything here is
formed from the drive's description and the difference equations of its observers alone. Prints the
worst disagreement of each quantity and fails beyond 1e-6.

usage: agreement.py HOST_SIM [CHAINS]
"""

import json
import os
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import control
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_discrete_are

LIMIT = 1e-6
# Ratios of the observer's noise densities, core/src/theory.md, (17): forces on the loads, random walk of
# the disturbance, over the noise of the measured force.
FORCE_RATIO, DISTURBANCE_RATIO = 0.3 / np.sqrt(1e-3), 300.0


def chain(drive):
    """Continuous model: A, B of the current, masses."""
    loads = drive["load"]
    actuator = drive["actuator"]
    mass = [actuator["mass"]] + [load["mass"] for load in loads]
    n = len(mass)
    stiffness = np.zeros((n, n))
    damping = np.zeros((n, n))
    for j, load in enumerate(loads):
        pair = np.zeros(n)
        pair[j], pair[j + 1] = 1.0, -1.0
        stiffness += load["stiffness"] * np.outer(pair, pair)
        damping += load["damping"] * np.outer(pair, pair)
    inverse = np.diag(1.0 / np.array(mass))
    a = np.zeros((2 * n, 2 * n))
    a[0::2, 1::2] = np.eye(n)
    a[1::2, 0::2] = -inverse @ stiffness
    a[1::2, 1::2] = -inverse @ damping
    a[1, 1] -= drive.get("friction", {}).get("viscous", 0.0) / mass[0]
    b = np.zeros((2 * n, 1))
    b[1, 0] = actuator["force_constant"] / mass[0]
    return a, b, np.array(mass)


def integral(a, q, t):
    """Integral of exp(A's) Q exp(As) from 0 to t (Van Loan)."""
    n = len(a)
    block = np.block([[-a.T, q], [np.zeros((n, n)), a]])
    e = expm(block * t)
    return e[n:, n:].T @ e[:n, n:]


def regulator(drive, a, b):
    """Sampled model and LQR gain of the continuous cost under zero-order hold."""
    n, t = len(a), drive["control"]["sample_time"]
    cost = drive["cost"]
    weights = np.empty(n)
    weights[0::2], weights[1::2] = cost["position"], cost["velocity"]
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[:n, n:] = a, b
    e = expm(big * t)
    ad, bd = e[:n, :n], e[:n, n:]
    w = integral(big, np.diag(np.append(weights, cost["current"])), t)
    q, s, r = w[:n, :n], w[:n, n:], w[n:, n:]
    x = solve_discrete_are(ad, bd, (q + q.T) / 2, r, s=s)
    k = np.linalg.solve(r + bd.T @ x @ bd, bd.T @ x @ ad + s.T)
    return ad, bd, k, weights


def observer(drive, a, mass):
    """Transition and Kalman gain of the anchored observer."""
    control_ = drive["control"]
    t, g_dist, g_reac = (
        control_[key] for key in ("sample_time", "disturbance_cutoff", "reaction_force_cutoff")
    )
    loads = len(mass) - 1
    n = 2 * loads + 3
    k1, c1 = drive["load"][0]["stiffness"], drive["load"][0]["damping"]
    f = np.zeros((n, n))
    f[: 2 * loads, : 2 * loads] = a[2:, 2:]
    q1, q2, d = n - 3, n - 2, n - 1
    f[q1, 0], f[q1, 1], f[q1, d], f[q1, q1] = -g_dist * k1, -g_dist * c1, g_dist, -g_dist
    f[q2, q1], f[q2, q2] = g_reac, -g_reac
    noise = np.zeros(n)
    noise[1 : 2 * loads : 2] = (FORCE_RATIO / mass[1:]) ** 2
    noise[d] = DISTURBANCE_RATIO**2
    # The actuator's mean velocity over the period, held, is the input.
    g = np.zeros(n)
    g[0 : 2 * loads : 2] = -1.0
    g[1 : 2 * loads : 2] = a[3::2, 1]
    g[q1] = g_dist * (c1 + drive.get("friction", {}).get("viscous", 0.0))
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[:n, n] = f, g
    big = expm(big * t)
    transition, b_mean = big[:n, :n], big[:n, n]
    process = integral(f.T, np.diag(noise), t)
    c = np.zeros((1, n))
    c[0, q2] = 1.0
    p = solve_discrete_are(transition.T, c.T, (process + process.T) / 2, np.array([[1.0 / t]]))
    gain = p @ c.T / (c @ p @ c.T + 1.0 / t)
    return transition, gain.ravel(), b_mean


def finite_horizon(a, b, weights, r, times):
    """Gain over the time to go, by integrating the Riccati differential equation."""
    n = len(a)
    q = np.diag(weights)

    def rate(_, flat):
        p = flat.reshape(n, n)
        pb = p @ b
        return (a.T @ p + p @ a - pb @ pb.T / r + q).ravel()

    solution = solve_ivp(
        rate, (0.0, times[-1]), np.zeros(n * n), method="DOP853", t_eval=times, rtol=1e-11, atol=1e-13
    )
    return [(b.T @ p.reshape(n, n) / r).ravel() for p in solution.y.T]


def controller(drive, k, transition, gain, b_mean, compensated):
    """The drive from measured position to command as a state-space system.

    `compensated` is the share of the disturbance found that the command removes: one while the drive
    moves, none while its compensation is held.

    Written as the difference equations that run in the drive; the matrices are its answers to unit
    inputs, which is all there is to know of a linear system.
    """
    t = drive["control"]["sample_time"]
    g_dist, g_reac = (drive["control"][key] for key in ("disturbance_cutoff", "reaction_force_cutoff"))
    m, k_f = drive["actuator"]["mass"], drive["actuator"]["force_constant"]
    a_dist, a_reac = np.exp(-g_dist * t), np.exp(-g_reac * t)
    # Both lags for a held current, exactly.
    lags = np.array([[-g_dist, 0.0, g_dist], [g_reac, -g_reac, 0.0], [0.0, 0.0, 0.0]])
    lags = expm(lags * t)
    loads = len(drive["load"])

    def step(state, position):
        before, raw_before, velocity_before, acceleration, first, second, current = state[:7]
        z = state[7:]
        raw = (position - before) / t
        velocity = a_dist * velocity_before + (1 - a_dist) * raw
        acceleration = a_reac * acceleration + (1 - a_reac) * (velocity - velocity_before) / t
        first, second, _ = lags @ [first, second, k_f * current]
        force = second - m * acceleration
        z = transition @ z + b_mean * raw
        z = z + gain * (force - z[-2])
        estimate = np.empty(2 * loads + 2)
        estimate[:2] = position, velocity
        estimate[2::2] = z[0 : 2 * loads : 2] + position
        estimate[3::2] = z[1 : 2 * loads : 2]
        command = -k @ estimate + compensated * z[-1] / k_f
        return np.concatenate([[position, raw, velocity, acceleration, first, second, command], z])

    n = 7 + len(gain)
    a = np.array([step(row, 0.0) for row in np.eye(n)]).T
    b = step(np.zeros(n), 1.0)[:, None]
    # The command is part of the new state.
    return control.ss(a, b, a[6:7], b[6:7], t)


def loop_margins(loop):
    """Margins of a sampled loop: python-control on a response that is dense where it matters."""
    t, nyquist = loop.dt, np.pi / loop.dt
    system = loop.A, loop.B, loop.C, loop.D

    def response(omega):
        a, b, c, d = system
        z = np.exp(1j * np.atleast_1d(omega) * t)[:, None, None]
        return (c @ np.linalg.solve(z * np.eye(len(a)) - a, b + 0j) + d)[:, 0, 0]

    grid = [np.geomspace(1e-5 * nyquist, nyquist * (1 - 1e-9), 2000)]
    for pole in np.linalg.eigvals(loop.A):
        s = np.log(pole + 0j) / t if abs(pole) > 1e-12 else 0j
        if s.imag > 0:
            # Around each resonance in steps of a small part of its width.
            grid.append(s.imag + abs(s.real) * np.linspace(-20, 20, 161))
    omega = np.unique(np.clip(np.concatenate(grid), 1e-5 * nyquist, nyquist * (1 - 1e-9)))
    l = response(omega)
    crossing = (np.sign(l.imag[1:]) != np.sign(l.imag[:-1])) & (l.real[1:] < 0)
    crossing |= (abs(l[1:]) > 1) != (abs(l[:-1]) > 1)
    distance = abs(1 + l)
    crossing[max(distance.argmin() - 1, 0) : distance.argmin() + 1] = True
    dense = [np.linspace(omega[i], omega[i + 1], 200) for i in np.flatnonzero(crossing)]
    omega = np.unique(np.concatenate([omega, *dense]))
    gains, phases, distances, _, at_gain, _ = control.stability_margins(
        control.frd(response(omega), omega, t), returnall=True, method="frd"
    )
    # At half the sample rate the response is real without crossing.
    end = response(nyquist)[0].real
    gains = np.append(gains, -1 / end) if end < 0 else gains
    grows, shrinks = gains[gains > 1], gains[gains < 1]
    delays = np.deg2rad(np.mod(phases, 360)) / at_gain
    return {
        "gain_margin_db": 20 * np.log10(grows.min()) if len(grows) else None,
        "gain_reduction_db": 20 * np.log10(shrinks.max()) if len(shrinks) else None,
        "phase_margin_deg": abs(phases).min(),
        "delay_margin": delays.min(),
        "peak_sensitivity": 1 / min(distances.min(), distance.min()),
    }


def margins_apart(found, loop):
    """Largest relative difference of the margins."""
    expected = loop_margins(loop)
    for name, value in expected.items():
        assert (found[name] is None) == (value is None), (name, found, expected)
    known = [name for name, value in expected.items() if value is not None]
    return max(abs(found[name] / expected[name] - 1) for name in known)


def apart(found, expected):
    """Largest difference, relative to the largest expected magnitude."""
    found, expected = np.asarray(found), np.asarray(expected)
    return np.abs(found - expected).max() / np.abs(expected).max()


def poles_apart(found, matrix):
    """How far the expected matrix is from one that has exactly the found poles, relative to it.

    Poles that lie close together move by the root of any rounding, so that two good routines
    disagree in them; the smallest singular value of A - pole does not. As sets they must still
    match.
    """
    found = np.array([complex(*pole) for pole in found])
    expected = list(np.linalg.eigvals(matrix))
    size, identity = np.linalg.norm(matrix, 2), np.eye(len(matrix))
    for pole in found:
        nearest = min(range(len(expected)), key=lambda i: abs(expected[i] - pole))
        assert abs(expected.pop(nearest) - pole) < 1e-3
    singular = (np.linalg.svd(matrix - pole * identity, compute_uv=False)[-1] for pole in found)
    return max(singular) / size


def toml(drive):
    """The drive as a file."""
    lines = []
    for name, table in drive.items():
        if isinstance(table, str):
            lines.append(f"{name} = {json.dumps(table)}")
            continue
        for entry in table if isinstance(table, list) else [table]:
            lines.append(f"[[{name}]]" if isinstance(table, list) else f"[{name}]")
            lines += [f"{key} = {json.dumps(value)}" for key, value in entry.items()]
    return "\n".join(lines)


def random_drive(rng):
    """A chain that a machine could have: sampled some 15 to 60 times per period of its fastest mode."""
    loads = int(rng.integers(1, 7))
    scale = 10 ** rng.uniform(1.5, 5.5)
    actuator = {"mass": 10 ** rng.uniform(-1.5, 0.5), "force_constant": 10 ** rng.uniform(0, 1.5)}
    drive = {"kind": str(rng.choice(["linear", "rotary"]))}
    drive["actuator"] = actuator | {"current_limit": 5.0}
    drive["encoder"] = {"resolution": 1e-6, "counter_bits": 16}
    drive["load"] = []
    for _ in range(loads):
        mass = actuator["mass"] * 10 ** rng.uniform(-0.7, 0.7)
        stiffness = scale * 10 ** rng.uniform(-0.5, 0.5)
        ratio = 10 ** rng.uniform(-3, -1.3)
        damping = 2 * ratio * np.sqrt(stiffness * mass)
        drive["load"].append({"mass": mass, "stiffness": stiffness, "damping": damping})
    # Every other drive has friction: an actuator that coasts to a stop in some periods of its modes.
    if rng.integers(2):
        drive["friction"] = {"viscous": actuator["mass"] * np.sqrt(scale) * 10 ** rng.uniform(-2, 0)}
    drive["control"] = {"observer": "anchored"}
    drive["cost"] = {"current": 10 ** rng.uniform(-1, 1)}
    a, _, _ = chain(drive)
    fastest = np.abs(np.linalg.eigvals(a)).max()
    sample_time = 2 * np.pi / fastest / rng.uniform(15, 60)
    drive["control"] |= {"sample_time": sample_time}
    drive["control"] |= {
        "disturbance_cutoff": 10 ** rng.uniform(-1.5, 0) / sample_time,
        "reaction_force_cutoff": 10 ** rng.uniform(-1.5, 0) / sample_time,
    }
    drive["cost"]["position"] = list(10 ** rng.uniform(1, 4, loads + 1))
    drive["cost"]["velocity"] = list(10 ** rng.uniform(-2, 1, loads + 1))
    return drive


def design(host_sim, drive):
    """What host-sim designs for a drive."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "drive.toml"
        path.write_text(toml(drive))
        run = subprocess.run([host_sim, "design", "--json", path], capture_output=True, text=True)
    if not run.stdout:
        raise SystemExit(f"design failed: {run.stderr}\n{toml(drive)}")
    return json.loads(run.stdout)


def placed_poles(host_sim, drive):
    """Slowest observer pole over that of the regulator, poles placed, by other eigenvalues."""
    speed = 3.0
    found = design(host_sim, drive | {"observer": {"design": "poles", "speed": speed}})
    a, b, mass = chain(drive)
    ad, bd, k, _ = regulator(drive, a, b)
    transition, _, _ = observer(drive, a, mass)
    c = np.zeros(len(transition))
    c[-2] = 1.0
    error = (np.eye(len(c)) - np.outer(found["observer_gain"], c)) @ transition
    slowest = [abs(np.linalg.eigvals(matrix)).max() for matrix in (ad - bd @ k, error)]
    return np.log(slowest[1]) / np.log(slowest[0]) / speed


def compare(host_sim, drive):
    """Disagreement of every quantity for one drive."""
    found = design(host_sim, drive)
    a, b, mass = chain(drive)
    ad, bd, k, weights = regulator(drive, a, b)
    transition, gain, b_mean = observer(drive, a, mass)
    c = np.zeros(len(gain))
    c[-2] = 1.0
    result = {
        "a": apart(found["a"], a),
        "ad": apart(found["ad"], ad),
        "bd": apart(found["bd"], bd.ravel()),
        "k": apart(found["k"], k.ravel()),
        "regulator_poles": poles_apart(found["regulator_poles"], ad - bd @ k),
        "observer_gain": apart(found["observer_gain"], gain),
        "observer_poles": poles_apart(
            found["observer_poles"],
            (np.eye(len(c)) - np.outer(gain, c)) @ transition,
        ),
    }
    t = drive["control"]["sample_time"]
    full_state = control.ss(ad, bd, k, 0, t)
    result["margins_full_state"] = margins_apart(found["margins_full_state"], full_state)
    position = np.zeros((1, len(ad)))
    position[0, 0] = 1.0
    plant = control.ss(ad, bd, -position, 0, t)
    moves, held = (
        controller(drive, k.ravel(), transition, gain, b_mean, compensated) * plant
        for compensated in (1.0, 0.0)
    )
    largest = max(abs(control.feedback(loop, 1).poles()).max() for loop in (moves, held))
    value = next(check["value"] for check in found["checks"] if check["name"] == "closed_loop")
    result["closed_loop"] = abs(value / largest - 1)
    for name, loop in (("margins", moves), ("margins_held", held)):
        assert (found[name] is None) == (largest >= 1), (largest, found[name])
        if found[name]:
            result[name] = margins_apart(found[name], loop)

    horizon = found["finite_horizon"]
    times = [entry["time_to_go"] for entry in horizon]
    expected = finite_horizon(a, b, weights, drive["cost"]["current"], times)
    result["finite_horizon"] = max(apart(h["k"], e) for h, e in zip(horizon, expected))

    # Undamped frequencies from the symmetric eigenvalue problem.
    stiffness = -np.diag(mass) @ a[1::2, 0::2]
    root = np.diag(mass**-0.5)
    squares, vectors = np.linalg.eigh(root @ stiffness @ root)
    frequency = np.sqrt(np.abs(squares))[1:] / (2 * np.pi)
    result["modes"] = apart([mode["frequency_hz"] for mode in found["modes"]], frequency)
    shapes = root @ vectors[:, 1:]
    result["shapes"] = max(
        # The sign of a shape is anybody's choice where two masses swing equally far.
        min(apart(mode["shape"], shape / s) for s in (peak, -peak))
        for mode, shape in zip(found["modes"], shapes.T)
        for peak in [np.abs(shape).max()]
    )
    return result


def main():
    host_sim = sys.argv[1]
    chains = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    rng = np.random.default_rng(20261124)
    default = tomllib.loads((Path(__file__).parents[2] / "host-sim/drive.toml").read_text())
    worst, unstable = {}, 0
    drives = [default] + [random_drive(rng) for _ in range(chains)]

    def one(numbered):
        i, drive = numbered
        found = compare(host_sim, drive)
        if i <= 10:
            found["placed_poles"] = abs(placed_poles(host_sim, drive) - 1)
        return found

    # Nearly all of the time is host-sim's.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(one, enumerate(drives)))
    for i, found in enumerate(results):
        unstable += "margins" not in found
        for name, value in found.items():
            worst[name] = max(worst.get(name, (0.0, 0)), (value, i))
    print(f"worst relative disagreement over the default drive and {chains} random chains,")
    print(f"{unstable} of which have no stable loop of their own:")
    for name, (value, i) in worst.items():
        print(f"  {name:18} {value:.1e} (chain {i})")
    bad = [name for name, (value, _) in worst.items() if not value < LIMIT]
    if bad:
        raise SystemExit(f"beyond {LIMIT}: {', '.join(bad)}")


main()
