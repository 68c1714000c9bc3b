"""What the tests share: drives that differ, and their chain written down anew."""

import arso
import numpy as np
import pytest


def chain(tables):
    """Continuous model of a drive file's chain: a, b of the current, masses."""
    loads = tables["load"]
    mass = np.array([tables["actuator"]["mass"]] + [load["mass"] for load in loads])
    n = len(mass)
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    for j, load in enumerate(loads):
        across = np.zeros(n)
        across[j], across[j + 1] = 1.0, -1.0
        stiffness += load["stiffness"] * np.outer(across, across)
        damping += load["damping"] * np.outer(across, across)
    a = np.zeros((2 * n, 2 * n))
    a[0::2, 1::2] = np.eye(n)
    a[1::2, 0::2] = -stiffness / mass[:, None]
    a[1::2, 1::2] = -damping / mass[:, None]
    b = np.zeros(2 * n)
    b[1] = tables["actuator"]["force_constant"] / mass[0]
    return a, b, mass, stiffness


def fine(tables):
    """Nothing that rounds: encoder of 10 nm, continuous current."""
    tables["encoder"].update(resolution=1e-8, counter_bits=32)
    tables["actuator"]["current_resolution"] = 0.0
    return tables


@pytest.fixture(scope="session")
def drive():
    return arso.Drive()


@pytest.fixture(scope="session")
def design(drive):
    return arso.design(drive)


@pytest.fixture(scope="session")
def smooth(drive):
    """The design of the same drive without rounding."""
    return arso.design(arso.Drive.from_dict(fine(drive.to_dict())))


@pytest.fixture(scope="session")
def other(drive):
    """A plant that differs: stiffer springs, a heavier last load, friction."""
    tables = drive.to_dict()
    for load in tables["load"]:
        load["stiffness"] *= 1.3
    tables["load"][-1]["mass"] *= 1.2
    tables["friction"] = {"coulomb": 0.15}
    return arso.Plant.from_dict(tables)
