"""Series and figures against simulations in numpy, and against what they must be."""

import threading
import time

import arso
import control
import numpy as np
import pytest
from conftest import chain
from scipy.linalg import expm
from scipy.signal import cont2discrete


def sampled(design):
    a, b, *_ = chain(design.drive.to_dict())
    ad, bd, *_ = cont2discrete((a, b[:, None], np.eye(len(a)), 0.0), design.sample_time)
    return ad, bd[:, 0]


def test_full_state_feedback_is_the_loop_in_numpy(smooth):
    """The raw step of 30 mm, current limit and all; the command is rounded to f32."""
    run = arso.simulate(smooth, step=0.03, law="full_state")
    ad, bd = sampled(smooth)
    x, target = np.zeros(8), np.tile([0.03, 0.0], 4)
    for truth, command in zip(run.truth, run.command):
        np.testing.assert_allclose(truth, x, atol=1e-7)
        current = np.clip(-smooth.k @ (x - target), -2.0, 2.0)
        assert command == pytest.approx(current, abs=1e-5)
        x = ad @ x + bd * current
    assert run.estimate is None and run.reaction_force is None


def linear_drive(design, target, periods):
    """The drive's own loop by the difference equations of its observers, in f64 and without rounding.

    Anchored observer, force observers of eqs. (18) and (19), feedback of the error, the disturbance compensated.
    """
    tables, t = design.drive.to_dict(), design.sample_time
    g_dist, g_reac = (tables["control"][f"{name}_cutoff"] for name in ("disturbance", "reaction_force"))
    m, k_f = tables["actuator"]["mass"], tables["actuator"]["force_constant"]
    a_dist, a_reac = np.exp(-g_dist * t), np.exp(-g_reac * t)
    lags = expm(t * np.array([[-g_dist, 0, g_dist], [g_reac, -g_reac, 0], [0, 0, 0]]))
    ad, bd = sampled(design)
    found = design.observer
    f, g, c, l = (found[name] for name in ("transition", "input", "output", "gain"))
    x, z = np.zeros(8), np.zeros(len(l))
    before = velocity_before = acceleration = first = second = current = 0.0
    reference = np.tile([target, 0.0], 4)
    states, commands = [], []
    for _ in range(periods):
        mean = (x[0] - before) / t
        velocity = a_dist * velocity_before + (1 - a_dist) * mean
        acceleration = a_reac * acceleration + (1 - a_reac) * (velocity - velocity_before) / t
        first, second, _ = lags @ [first, second, k_f * current]
        before, velocity_before = x[0], velocity
        z = f @ z + g * mean
        z = z + l * (second - m * acceleration - c @ z)
        estimate = np.concatenate([[x[0], velocity], z[:6] + np.tile([x[0], 0.0], 3)])
        current = -design.k @ (estimate - reference) + z[-1] / k_f
        states.append(x)
        commands.append(current)
        x = ad @ x + bd * current
    return np.array(states), np.array(commands)


def test_the_core_is_the_linear_loop_in_numpy(smooth):
    """While it moves: a step of 2 mm, far from the current limit. The core counts in f32."""
    target, periods = 2e-3, 120
    run = arso.simulate(smooth, step=target)
    states, commands = linear_drive(smooth, target, periods)
    np.testing.assert_allclose(run.truth[:periods, 0::2], states[:, 0::2], atol=2e-3 * target)
    assert np.abs(run.command[:periods] - commands).max() < 0.02 * np.abs(commands).max()


def test_the_observer_of_python_control_follows_the_core(smooth):
    """Fed with what the core measured it estimates what the core estimated (in f32)."""
    run = arso.simulate(smooth, step=0.01)
    position = run.estimate[:, 0]
    mean = np.diff(position, prepend=position[0]) / smooth.sample_time
    observer = arso.control_systems(smooth).observer
    response = control.forced_response(observer, run.time, np.stack([mean, run.reaction_force]))
    relative = np.asarray(response.outputs)[0:6:2].T
    assert np.abs(relative + position[:, None] - run.estimate[:, 2::2]).max() < 5e-6


def test_figures_are_those_of_the_series(design):
    run = arso.simulate(design, step=0.03, duration=1.2)
    assert len(run) == 1200 and run.experiment == "step" and run.law == "core"
    np.testing.assert_allclose(run.time, np.arange(1200) * 1e-3, atol=1e-12)
    x2 = run.truth[:, 4]
    outside = np.flatnonzero(abs(x2 - 0.03) > 0.02 * 0.03)[-1]
    metrics = run.metrics
    assert metrics["settling_time"] == pytest.approx(run.time[outside + 1])
    assert metrics["overshoot"] == pytest.approx(100 * (x2.max() / 0.03 - 1))
    assert metrics["peak_current"] == abs(run.command).max() <= 2.0
    error = np.sqrt(np.mean((run.estimate - run.truth)[:, 0::2] ** 2, axis=0))
    np.testing.assert_allclose(metrics["estimation_error"], error, rtol=1e-9)
    # The encoder's counter is that of the position.
    counts = np.round(run.truth[:, 0] / 1e-6) % 65536
    away = (run.count.astype(float) - run.count[0] - counts + 32768) % 65536 - 32768
    assert abs(away).max() <= 1
    np.testing.assert_array_equal(run.applied_current[1:], run.command[:-1])
    for series in (run.truth, run.estimate, run.command, run.reference, run.disturbance, run.reaction_force):
        assert np.isfinite(series).all()
    force = run.truth @ design.drive.chain["reaction_force"]
    np.testing.assert_allclose(run.true_reaction_force, force, atol=1e-9)


def test_moves_end_where_they_were_sent(design):
    run = arso.simulate(design, move=[0.03, -0.01, 0.005])
    targets = [move["target"] for move in run.moves]
    np.testing.assert_allclose(targets, [0.03, 0.02, 0.025])
    ends = [move["at"] for move in run.moves[1:]] + [run.time[-1] + design.sample_time]
    for end, move in zip(ends, run.moves):
        last = run.truth[np.searchsorted(run.time, end - 1e-9) - 1, 0::2]
        np.testing.assert_allclose(last, move["target"], atol=5e-6)
        assert move["metrics"]["settling_time"] < 0.08 and not move["retargeted"]
    assert run.metrics == run.moves[-1]["metrics"]
    run = arso.simulate(design, move=[0.03, -0.01], at=[0.0, 0.04])
    assert [move["retargeted"] for move in run.moves] == [True, False]
    assert run.truth[-1, 0] == pytest.approx(0.02, abs=5e-6)


def test_a_plan_is_no_faster_than_the_bound_and_nearly_as_fast(design, other):
    least = arso.bound(design.drive, distance=0.03)
    settled = arso.simulate(design, move=0.03).metrics["settling_time"]
    assert least["settled"] <= settled < 1.2 * least["settled"] < least["rest"]
    # A wrong model costs time, which no bound has.
    assert arso.simulate(design, other, move=0.03).metrics["settling_time"] > 2 * settled
    assert arso.bound(design.drive, other)["settled"] != least["settled"]


def test_threads_simulate_beside_one_another(design):
    """The interpreter is free while a bound is computed, and results do not depend on who else runs."""
    alone = arso.simulate(design, step=0.03)
    done, runs = threading.Event(), []

    def work():
        arso.bound(design.drive, distance=0.05)
        done.set()

    worker = threading.Thread(target=work)
    began = time.perf_counter()
    worker.start()
    seen = 0
    while not done.is_set():
        seen += 1
        if len(runs) < 3:
            runs.append(arso.simulate(design, step=0.03))
        time.sleep(1e-3)
    worker.join()
    assert seen > 3, f"{seen} turns in {time.perf_counter() - began:.2f} s"
    for run in runs:
        np.testing.assert_array_equal(run.truth, alone.truth)


def test_a_drive_that_stops_itself_raises_with_its_run(drive):
    tables = drive.to_dict()
    tables["protection"] = {"velocity": 0.1}
    with pytest.raises(arso.DriveFault, match=r"stopped after .* with fault 1[01]") as caught:
        arso.simulate(arso.Drive.from_dict(tables), step=0.03)
    run = caught.value.run
    assert run.metrics["fault"] in (10, 11)
    assert isinstance(caught.value, RuntimeError)
    # Nothing is commanded any more once the amplifier is off.
    assert not run.command[-100:].any()
