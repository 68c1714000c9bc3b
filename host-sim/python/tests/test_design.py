"""Models, gains and poles against scipy, numpy and python-control."""

import arso
import control
import numpy as np
import pytest
from conftest import chain
from scipy.linalg import eigh
from scipy.signal import cont2discrete


def same_poles(found, expected, within):
    """As sets."""
    left = list(expected)
    assert len(found) == len(left)
    for pole in found:
        nearest = min(range(len(left)), key=lambda i: abs(left[i] - pole))
        assert abs(left.pop(nearest) - pole) < within


def drive_with(loads, seed):
    """The paper's drive with another chain."""
    rng = np.random.default_rng(seed)
    tables = arso.Drive().to_dict()
    tables["cost"].update(position=[225.0] * (loads + 1), velocity=[0.2] * (loads + 1))
    tables["load"] = [
        {"mass": m, "stiffness": k, "damping": c}
        for m, k, c in zip(
            rng.uniform(0.01, 0.04, loads), rng.uniform(200, 500, loads), rng.uniform(0.05, 0.2, loads)
        )
    ]
    return arso.Drive.from_dict(tables)


@pytest.mark.parametrize("loads", [1, 2, 3, 6])
def test_models_and_poles_are_those_of_scipy_and_numpy(loads):
    drive = arso.Drive() if loads == 3 else drive_with(loads, seed=loads)
    design = arso.design(drive)
    a, b, mass, stiffness = chain(drive.to_dict())
    np.testing.assert_allclose(design.a, a, rtol=1e-12)
    np.testing.assert_allclose(design.b, b, rtol=1e-12)
    np.testing.assert_allclose(drive.chain["a"], a, rtol=1e-12)
    np.testing.assert_allclose(drive.chain["mass"], mass)
    ad, bd, *_ = cont2discrete((a, b[:, None], np.eye(len(a)), 0.0), drive.sample_time)
    np.testing.assert_allclose(design.ad, ad, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(design.bd, bd[:, 0], rtol=1e-9, atol=1e-15)
    same_poles(design.poles, np.linalg.eigvals(ad - np.outer(bd, design.k)), 1e-8)

    frequencies = np.sqrt(eigh(stiffness, np.diag(mass), eigvals_only=True)[1:]) / (2 * np.pi)
    np.testing.assert_allclose([m["frequency_hz"] for m in drive.chain["modes"]], frequencies, rtol=1e-9)

    found = design.observer
    error = (np.eye(len(found["gain"])) - np.outer(found["gain"], found["output"])) @ found["transition"]
    same_poles(found["poles"], np.linalg.eigvals(error), 1e-6)
    for matrix in (design.a, design.ad, found["transition"]):
        assert matrix.flags.c_contiguous and np.isfinite(matrix).all()


def test_the_gain_is_the_regulator_of_the_sampled_cost(design):
    """scipy's Riccati solution for the cost integrated over the period by a fine sum."""
    tables = design.drive.to_dict()
    a, b, *_ = chain(tables)
    n, parts = len(a), 2000
    weights = np.zeros(n + 1)
    weights[0:n:2], weights[1:n:2] = tables["cost"]["position"], tables["cost"]["velocity"]
    weights[n] = tables["cost"]["current"]
    fine = cont2discrete((a, b[:, None], np.eye(n), 0.0), design.sample_time / (2 * parts))
    step = np.eye(n + 1)
    step[:n, :n], step[:n, n:] = fine[0], fine[1]
    flow, integral = np.eye(n + 1), np.zeros((n + 1, n + 1))
    for i in range(2 * parts + 1):
        # Simpson's rule.
        share = 1 if i in (0, 2 * parts) else 4 if i % 2 else 2
        integral += share * flow.T @ (weights[:, None] * flow)
        flow = step @ flow
    integral *= design.sample_time / (6 * parts)
    gain, _, _ = control.dlqr(
        design.ad, design.bd[:, None], integral[:n, :n], integral[n:, n:], integral[:n, n:]
    )
    np.testing.assert_allclose(design.k, gain[0], rtol=1e-6)


@pytest.mark.parametrize("held", [False, True])
def test_the_loop_is_plant_and_controller_in_feedback(design, held):
    systems = arso.control_systems(design, held=held)
    assert all(isinstance(system, control.StateSpace) for system in systems)
    assert all(system.dt == design.sample_time for system in systems)
    position = systems.plant[0, 0]
    feedback = control.feedback(position, systems.controller, sign=1)
    same_poles(systems.loop.poles(), feedback.poles(), 1e-5)
    assert abs(systems.loop.poles()).max() < 1
    same_poles(systems.observer.poles(), design.observer["poles"], 1e-6)
    omega = 2 * np.pi * np.geomspace(0.5, 450, 60)
    series = -(position * systems.controller)(np.exp(1j * omega * design.sample_time))
    around = systems.open_loop(np.exp(1j * omega * design.sample_time))
    np.testing.assert_allclose(around, series, rtol=1e-6)


def test_margins_are_those_of_python_control(design):
    for held, name in [(False, "drive"), (True, "held")]:
        loop = arso.control_systems(design, held=held).open_loop
        omega = 2 * np.pi * np.geomspace(1, 499, 4000)
        response = loop(np.exp(1j * omega * design.sample_time))
        gain, phase, distance, *_ = control.stability_margins(
            control.frd(response, omega, design.sample_time), returnall=True, method="frd"
        )
        found = design.margins[name]
        assert 20 * np.log10(gain[gain > 1].min()) == pytest.approx(found["gain_margin_db"], abs=0.02)
        assert abs(phase).min() == pytest.approx(found["phase_margin_deg"], abs=0.05)
        assert 1 / abs(1 + response).min() == pytest.approx(found["peak_sensitivity"], rel=1e-3)


def test_a_stated_delay_is_in_the_plant(drive):
    tables = drive.to_dict()
    tables["actuator"]["delay"] = 2 * drive.sample_time
    late = arso.control_systems(arso.design(arso.Drive.from_dict(tables))).plant
    plant = arso.control_systems(arso.design(drive)).plant
    time = np.arange(40) * drive.sample_time
    current = np.sin(300 * time)
    on_time = control.forced_response(plant, time, current).outputs
    delayed = control.forced_response(late, time, current).outputs
    np.testing.assert_allclose(delayed[:, 2:], on_time[:, :-2], atol=1e-12)


def test_checks_have_a_verdict_each(design):
    design.require_sound()
    checks = design.checks
    assert {check["verdict"] for check in checks} <= {"pass", "warn"}
    assert all(check["name"] and np.isfinite(check["limit"]) for check in checks)
    tables = design.drive.to_dict()
    tables["friction"] = {"coulomb": 20.0}
    refused = arso.design(arso.Drive.from_dict(tables))
    assert "refuse" in {check["verdict"] for check in refused.checks}
    with pytest.raises(RuntimeError, match="refuses it"):
        refused.require_sound()
    with pytest.raises(RuntimeError, match="refuses it"):
        arso.simulate(refused, move=0.03)
