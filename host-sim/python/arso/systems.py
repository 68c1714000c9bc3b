"""Plant, observer and loop of a design as systems of python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ._arso import Design

if TYPE_CHECKING:
    import control


class ControlSystems(NamedTuple):
    """Sampled linear systems of a drive, ``dt`` its control period; no limits, rounding or Coulomb friction.

    States of the plant are ``x_a v_a x_1 v_1 …`` (m, m/s), behind them the memory of a stated delay or lag.
    """

    plant: control.StateSpace
    """From ``current`` (A) to the states of the chain."""
    observer: control.StateSpace
    """From the input of the observer, ``mean_velocity`` (m/s) of the actuator or ``current`` (A), and the measured
    ``force`` (N) to its states, corrected; the anchored one estimates the loads relative to the actuator."""
    controller: control.StateSpace
    """The whole drive: from the measured position of the actuator ``x_a`` (m) to ``command`` (A), reference zero."""
    open_loop: control.StateSpace
    """From ``current`` around the loop to the negative ``command``: what margins are taken of."""
    loop: control.StateSpace
    """Plant and drive together: from a ``disturbance`` (A, added to the command) to the states of the chain and the
    ``command`` (A)."""


def control_systems(design: Design, *, held: bool = False) -> ControlSystems:
    """Plant, observer and loop of a design as ``control.StateSpace``.

    Parameters
    ----------
    design : Design
    held : bool, optional
        The drive as it is held at rest, where the compensation of the disturbance stands still; as it moves when
        not given.

    Returns
    -------
    ControlSystems

    Raises
    ------
    ImportError
        When python-control is not installed: ``pip install arso[control]``.

    Examples
    --------
    >>> import arso
    >>> systems = arso.control_systems(arso.design())
    >>> bool(abs(systems.loop.poles()).max() < 1)
    True
    """
    import control

    dt = design.sample_time
    masses = ["a", *range(1, design.drive.loads + 1)]
    states = [f"{what}_{mass}" for mass in masses for what in "xv"]
    n = len(states)

    ad, bd = design.plant_matrices()
    memory = [f"late_{i}" for i in range(len(bd) - n)]
    chain = np.eye(n, len(bd))
    plant = control.ss(
        ad,
        bd[:, None],
        chain,
        np.zeros((n, 1)),
        dt,
        name="plant",
        inputs=["current"],
        states=states + memory,
        outputs=states,
    )

    found = design.observer
    identity = np.eye(len(found["gain"]))
    corrected = identity - np.outer(found["gain"], found["output"])
    transition = corrected @ found["transition"]
    inputs = np.column_stack([corrected @ found["input"], found["gain"]])
    estimates = [f"z_{i}" for i in range(len(identity))]
    driven_by = "mean_velocity" if found["name"] == "anchored" else "current"
    # What it says is what it keeps: the state after the correction.
    observer = control.ss(
        transition,
        inputs,
        transition,
        inputs,
        dt,
        name="observer",
        inputs=[driven_by, "force"],
        outputs=estimates,
    )

    a, b, c, d = design.controller_matrices(held=held)
    controller = control.ss(
        a, b[:, None], c[None, :], [[d]], dt, name="controller", inputs=["x_a"], outputs=["command"]
    )

    # The command of a period acts over it, on a plant that is strictly proper.
    position = np.eye(1, len(bd))
    around = np.block([[ad, np.zeros((len(bd), len(b)))], [np.outer(b, position), a]])
    command = np.concatenate([d * position[0], c])
    into = np.concatenate([bd, np.zeros(len(b))])
    open_loop = control.ss(
        around,
        into[:, None],
        -command[None, :],
        [[0.0]],
        dt,
        name="open_loop",
        inputs=["current"],
        outputs=["negative_command"],
    )
    loop = control.ss(
        around + np.outer(into, command),
        into[:, None],
        np.vstack([np.eye(n, len(into)), command]),
        np.zeros((n + 1, 1)),
        dt,
        name="loop",
        inputs=["disturbance"],
        outputs=[*states, "command"],
    )
    return ControlSystems(plant, observer, controller, open_loop, loop)
