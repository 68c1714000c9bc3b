"""Learning from a record, and the comparison."""

import arso
import numpy as np
import pytest


@pytest.fixture(scope="module")
def run(design, other):
    return arso.simulate(design, other, move=0.03, duration=0.4)


def test_one_move_teaches_the_machine(drive, design, other, run):
    """Every parameter of the plant that made the record, and gains that move it in little more than the bound."""
    learned = arso.learn(drive, {"count": run.count, "current": run.applied_current})
    truth = other.to_dict()
    found = learned.drive.to_dict()
    assert learned.fit_percent > 99.9 and learned.refused is None
    for load, expected in zip(found["load"], truth["load"]):
        assert load["mass"] == pytest.approx(expected["mass"], rel=2e-3)
        assert load["stiffness"] == pytest.approx(expected["stiffness"], rel=2e-3)
    assert found["friction"]["coulomb"] == pytest.approx(0.15, rel=0.01)
    assert learned.parameters["load[3].mass"]["value"] == pytest.approx(found["load"][2]["mass"], rel=1e-6)
    np.testing.assert_allclose(
        learned.modes_hz["after"], [m["frequency_hz"] for m in learned.drive.chain["modes"]], rtol=1e-6
    )
    benefit = learned.benefit
    assert benefit["after"] < 1.2 * benefit["bound"] < benefit["before"]
    # The claim holds on the plant itself.
    again = arso.simulate(learned.drive, other, move=0.03).metrics["settling_time"]
    assert again == pytest.approx(benefit["after"], abs=2e-3)


def test_records_that_say_nothing_are_refused(drive, run, tmp_path):
    with pytest.raises(ValueError, match='"current" is missing'):
        arso.learn(drive, {"count": run.count})
    with pytest.raises(ValueError, match="must be as many"):
        arso.learn(drive, {"count": run.count, "current": run.command[:-1]})
    with pytest.raises(ValueError, match="must be an array of numbers"):
        arso.learn(drive, {"count": run.count, "current": "much"})
    beyond = run.applied_current.copy()
    beyond[57] = 9.0
    with pytest.raises(ValueError, match="record, sample 57: .*beyond the drive's current_limit"):
        arso.learn(drive, {"count": run.count, "current": beyond})
    with pytest.raises(ValueError, match="record, sample 3"):
        arso.learn(
            drive,
            {
                "count": run.count,
                "current": run.command,
                "time": np.where(np.arange(len(run)) == 3, np.nan, run.time),
            },
        )
    with pytest.raises(ValueError, match="never changes"):
        arso.learn(drive, {"count": run.count, "current": np.zeros(len(run))})
    with pytest.raises(ValueError, match="200 at least"):
        arso.learn(drive, {"count": run.count[:50], "current": run.command[:50]})
    with pytest.raises(FileNotFoundError, match="nowhere.csv"):
        arso.learn(drive, tmp_path / "nowhere.csv")
    with pytest.raises(TypeError, match="`record`: must be a path, a Run"):
        arso.learn(drive, 3)


def test_a_file_is_read_as_its_arrays_are(drive, run, tmp_path):
    """The same refusal from both: the path leads to the same reader."""
    record = {"time": run.time[:60], "count": run.count[:60], "current": run.applied_current[:60]}
    path = tmp_path / "record.csv"
    rows = zip(record["time"], record["count"], record["current"])
    path.write_text("time[s],count[1],applied_current[A]\n" + "".join(f"{t},{c},{i}\n" for t, c, i in rows))
    sentences = []
    for source in (record, path, str(path)):
        with pytest.raises(ValueError) as caught:
            arso.learn(drive, source)
        sentences.append(str(caught.value).split(": ", 1)[1])
    assert len(set(sentences)) == 1


def test_all_rivals_are_compared(drive):
    seen = []
    found = arso.compare(drive, evaluations=20, plants=1, progress=lambda *said: seen.append(said))
    assert {"drive", "full state", "PD", "PD + ZV"} <= {law["law"] for law in found["laws"]}
    for law in found["laws"] + found["moves"]:
        assert len(law["outcomes"]) == len(found["bounds"]) == 9
    nominal = found["bounds"][0]["bound"]["settled"]
    assert nominal == pytest.approx(arso.bound(drive)["settled"])
    for law in found["laws"]:
        metrics = law["outcomes"][0]["metrics"]
        assert metrics["settling_time"] is None or metrics["settling_time"] >= nominal
    assert seen and all(done <= of for done, of, _ in seen)
