"""Design and simulation of a motor drive that positions a flexible load with no sensor on it.

The same control core as on the drive board, the same design and the same figures as the program ``host-sim``,
with numpy arrays. SI units throughout; of a rotary drive read kg m² for kg, rad for m, N m for N.

>>> import arso
>>> design = arso.design(arso.Drive())
>>> run = arso.simulate(design, move=0.03)
>>> run.truth.shape == (len(run), 8)
True

Errors are exceptions with host-sim's sentence: ValueError for what can be corrected in arguments and files,
OSError for files that cannot be read, RuntimeError for what fails. Long calls release the interpreter.
"""

from ._arso import (
    Design,
    Drive,
    DriveFault,
    Learned,
    Plant,
    Run,
    bound,
    compare,
    design,
    learn,
    merge_sweep,
    read_sweep,
    simulate,
    sweep,
)
from .systems import ControlSystems, control_systems

__all__ = [
    "ControlSystems",
    "Design",
    "Drive",
    "DriveFault",
    "Learned",
    "Plant",
    "Run",
    "bound",
    "compare",
    "control_systems",
    "design",
    "learn",
    "merge_sweep",
    "read_sweep",
    "simulate",
    "sweep",
]
