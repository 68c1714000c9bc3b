"""Sweeps: rows against simulate, parts against the whole, and being ended."""

import arso
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

SWEEP = {
    "seed": 3,
    "samples": 2,
    "step": 0.03,
    "duration": 1.2,
    "laws": ["drive", "full state"],
    "vary": {
        "plant.load.3.mass": {"grid": [0.019, 0.022]},
        "plant.load.1.stiffness": {"uniform": [270.0, 330.0]},
    },
}


def test_rows_are_what_simulate_says(tmp_path, drive):
    out = tmp_path / "sweep.parquet"
    summary = arso.sweep(SWEEP, out)
    columns = arso.read_sweep(out)
    rows = len(columns["sample"])
    assert summary["samples"] == 4 and rows == 8
    assert {len(values) for values in columns.values()} == {8}
    for row in range(rows):
        tables = drive.to_dict()
        tables["load"][2]["mass"] = columns["plant.load.3.mass"][row]
        tables["load"][0]["stiffness"] = columns["plant.load.1.stiffness"][row]
        law = {"drive": "core", "full state": "full_state"}[columns["law"][row]]
        metrics = arso.simulate(drive, arso.Plant.from_dict(tables), step=0.03, law=law).metrics
        assert columns["overshoot"][row] == pytest.approx(metrics["overshoot"], rel=1e-9)
        assert columns["peak_current"][row] == pytest.approx(metrics["peak_current"], rel=1e-9)
        band = metrics["within_band_from"]
        np.testing.assert_equal(columns["within_band_from"][row], np.nan if band is None else band)
    for law in summary["laws"]:
        settled = columns["settling_time"][columns["law"] == law["law"]]
        assert law["not_settled"] == np.isnan(settled).sum()


def test_parts_make_the_whole(tmp_path):
    whole, merged = tmp_path / "whole.parquet", tmp_path / "merged.parquet"
    parts = [tmp_path / f"part-{i}.parquet" for i in (1, 2)]
    first = arso.sweep(SWEEP, whole)
    for i, part in enumerate(parts, 1):
        arso.sweep(SWEEP, part, shard=f"{i}/2")
    assert arso.merge_sweep(merged, parts[::-1]) == first
    assert merged.read_bytes() == whole.read_bytes()
    with pytest.raises((ValueError, RuntimeError), match="part|missing"):
        arso.merge_sweep(merged, parts[:1])
    assert merged.read_bytes() == whole.read_bytes()


def test_what_progress_raises_ends_a_sweep_and_the_next_goes_on(tmp_path):
    out, seen = tmp_path / "sweep.parquet", []

    def enough(done, of):
        assert of == 4000
        raise KeyboardInterrupt

    large = SWEEP | {"samples": 2000}
    with pytest.raises(KeyboardInterrupt):
        arso.sweep(large, out, progress=enough)
    assert not out.exists()
    small = SWEEP | {"samples": 20}
    arso.sweep(small, out, progress=lambda done, of: seen.append((done, of)))
    assert seen[-1] == (40, 40) and seen == sorted(seen)


def test_descriptions_that_cannot_be_used_are_refused(tmp_path):
    out = tmp_path / "sweep.parquet"
    for change, sentence in [
        ({"laws": ["magic"]}, '^dictionary: law "magic": must be one of'),
        ({"vary": {"plant.load.9.mass": {"grid": [1.0]}}}, r"plant\.load\.9\.mass"),
        ({"duration": -1.0}, "duration = -1"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            arso.sweep(SWEEP | change, out)
    with pytest.raises(ValueError, match="`shard` 3/2: must be I/N"):
        arso.sweep(SWEEP, out, shard="3/2")
    with pytest.raises(FileNotFoundError, match="cannot read nowhere.toml"):
        arso.sweep("nowhere.toml", out)
    with pytest.raises(TypeError, match="`description`: must be a path or a dictionary"):
        arso.sweep(3, out)


def test_a_sweep_is_what_others_read(tmp_path):
    out = tmp_path / "sweep.parquet"
    arso.sweep(SWEEP, out)
    columns, table = arso.read_sweep(out), pyarrow.parquet.read_table(out)
    assert list(columns) == table.column_names
    for name, values in columns.items():
        others = table[name].to_pylist()
        if values.dtype == object:
            assert list(values) == others
        else:
            np.testing.assert_array_equal(values, [np.nan if x is None else x for x in others])


def test_what_is_no_sweep_is_not_read_as_one(tmp_path):
    out = tmp_path / "sweep.parquet"

    def refused(sentence):
        before = out.read_bytes()
        with pytest.raises(ValueError, match=f"sweep.parquet: {sentence}") as caught:
            arso.read_sweep(out)
        assert "\n" not in str(caught.value)
        assert out.read_bytes() == before

    out.write_text("nothing")
    refused("is no whole Parquet file")
    whole, single = pyarrow.array([1, 2], "int32"), pyarrow.array([0.5, 1.5], "float32")
    pyarrow.parquet.write_table(pyarrow.table({"sample": whole, "overshoot": single}), out)
    refused("has no digest: it is no file of a sweep")
    arso.sweep(SWEEP, out)
    damaged = bytearray(out.read_bytes())
    damaged[len(damaged) // 3] ^= 4
    out.write_bytes(damaged)
    refused("is damaged")
