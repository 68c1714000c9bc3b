"""What the package promises beside its figures: exceptions, docstrings, stubs, pickles."""

import doctest
import inspect
import pickle
import subprocess
import sys

import arso
import numpy as np
import pytest


def changed(drive, **values):
    """Tables of a drive, with other values of its actuator."""
    tables = drive.to_dict()
    tables["actuator"].update(values)
    return tables


@pytest.mark.parametrize(
    ("call", "kind", "sentence"),
    [
        (lambda d: arso.Drive("nowhere.toml"), FileNotFoundError, "cannot read nowhere.toml: No such file"),
        (lambda d: arso.Drive("."), IsADirectoryError, "cannot read .: "),
        (
            lambda d: arso.Drive.from_toml(d.to_toml().replace("mass = 0.059", "mass = -1"), "my.toml"),
            ValueError,
            r"^my.toml:5: actuator.mass = -1: must be from 1e-9 to 1e9 kg$",
        ),
        (lambda d: arso.Drive.from_dict({"actuator": {"mass": None}}), ValueError, "no tables of a file"),
        (lambda d: arso.Drive.from_dict({}), ValueError, "missing field `actuator`"),
        (
            lambda d: arso.Drive.from_dict(changed(d, mass=-1.0)),
            ValueError,
            r"^dictionary: actuator.mass = -1: must be from 1e-9 to 1e9 kg$",
        ),
        (
            lambda d: arso.Drive.from_dict(changed(d, mass="heavy")),
            ValueError,
            '^dictionary: mass: invalid type: string "heavy", expected f64$',
        ),
        (
            lambda d: arso.Drive.from_dict(changed(d, maas=1.0)),
            ValueError,
            "^dictionary: unknown field `maas`",
        ),
        (
            lambda d: arso.Drive.from_dict(changed(d, delay=-1.0)),
            ValueError,
            "^dictionary: actuator.delay = -1: must be ",
        ),
        (
            lambda d: arso.Plant.from_dict(changed(d, mass=-1.0)),
            ValueError,
            "^dictionary: actuator.mass = -1: must be ",
        ),
        (lambda d: arso.Plant.from_toml("mass = 1"), ValueError, "unknown field `mass`"),
        (lambda d: arso.simulate(d), ValueError, "give one of `move`, `step` and `experiment`"),
        (lambda d: arso.simulate(d, move=0.03, step=0.03), ValueError, "give one of"),
        (lambda d: arso.simulate(d, step=np.nan), ValueError, "`step` NaN: must be from a count"),
        (lambda d: arso.simulate(d, move=0.0), ValueError, "`move` 0: must be one count"),
        (lambda d: arso.simulate(d, move=[]), ValueError, r"`move` \[\]: must be one distance"),
        (
            lambda d: arso.simulate(d, move=[0.01, 0.01], at=0.1),
            ValueError,
            "`at` 0.1: must be one time for each",
        ),
        (lambda d: arso.simulate(d, step=0.01, at=0.1), ValueError, "give `move`"),
        (
            lambda d: arso.simulate(d, move=0.03, duration=np.nan),
            ValueError,
            "`duration` NaN: must be two control",
        ),
        (
            lambda d: arso.simulate(d, move=0.03, duration=1e9),
            ValueError,
            "`duration` 1000000000: must be 1000000",
        ),
        (
            lambda d: arso.simulate(d, move=[0.01, 0.01], at=[0, 1], duration=0.5),
            ValueError,
            "begins at 1 s only",
        ),
        (
            lambda d: arso.simulate(d, experiment="fig9"),
            ValueError,
            '`experiment` "fig9": must be one of "fig3"',
        ),
        (lambda d: arso.simulate(d, move=0.03, law="pd"), ValueError, '`law` "pd": must be "core"'),
        (
            lambda d: arso.simulate("drive.toml", move=0.03),
            TypeError,
            "`design`: must be a Design or a Drive, not str",
        ),
        (
            lambda d: arso.simulate(d, {}, move=0.03),
            TypeError,
            "`plant`: must be a Plant or a Drive, not dict",
        ),
        (lambda d: arso.bound(d, distance=np.inf), ValueError, "`distance` inf: must be from 1e-9 to 1e6 m"),
        (lambda d: arso.compare(d, evaluations=3), ValueError, "`evaluations` 3: must be from 20"),
        (lambda d: arso.compare(d, plants=10**6), ValueError, "`plants` 1000000: must be 100000 at most"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(drive, call, kind, sentence):
    with pytest.raises(kind, match=sentence) as caught:
        call(drive)
    assert "\n" not in str(caught.value)


def test_a_plant_of_another_size_is_refused(drive):
    tables = drive.to_dict()
    tables["load"].pop()
    plant = arso.Plant.from_dict(tables)
    for call in (lambda: arso.simulate(drive, plant, move=0.03), lambda: arso.bound(drive, plant)):
        with pytest.raises(ValueError, match="the plant has 2 loads and the drive 3"):
            call()


def test_descriptions_survive_every_way_there_and_back(drive):
    text = drive.to_toml()
    assert "# kg" in text
    again = [
        arso.Drive.from_toml(text),
        arso.Drive.from_dict(drive.to_dict()),
        pickle.loads(pickle.dumps(drive)),
        pickle.loads(pickle.dumps(arso.design(drive))).drive,
    ]
    for other in again:
        assert other.to_dict() == drive.to_dict()
        assert (other.kind, other.loads, other.sample_time) == ("linear", 3, 1e-3)
    plant = pickle.loads(pickle.dumps(arso.Plant.from_dict(drive.to_dict())))
    assert plant.to_dict() == drive.to_dict()


def public():
    """Everything that a user meets, by its name."""
    for name in arso.__all__:
        yield name, getattr(arso, name)
        if inspect.isclass(getattr(arso, name)) and not issubclass(getattr(arso, name), tuple):
            for member, value in vars(getattr(arso, name)).items():
                if not member.startswith("_"):
                    yield f"{name}.{member}", value


def test_everything_has_a_docstring():
    without = [name for name, value in public() if not (value.__doc__ or "").strip()]
    assert without == []


def test_the_examples_in_docstrings_hold():
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    texts = [("arso", arso.__doc__)] + [(name, value.__doc__ or "") for name, value in public()]
    for name, text in texts:
        runner.run(parser.get_doctest(inspect.cleandoc(text), {}, name, None, None))
    assert runner.summarize().failed == 0 and runner.tries > 5


def test_the_stubs_are_those_of_the_module():
    checked = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "arso._arso", "--concise"], capture_output=True, text=True
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_python_control_is_imported_when_it_is_asked_for():
    code = "import sys, arso; assert 'control' not in sys.modules and 'scipy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
