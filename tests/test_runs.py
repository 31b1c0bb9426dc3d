"""Measured runs: what is read, and what is said of files that are not runs."""

import numpy as np
import pytest

from joda import JodaError
from joda.measured.run_files import read_measurement, read_run
from joda.measured.runs import QuasiStatic, Run, check_known, evened

HEAD = "time,position,force\n"
ROWS = "0,0.1,1\n0.1,0.2,2\n0.3,0.3,\n0.4,0.5,4\n"


def read(folder, text):
    path = folder / "run.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_run(path)


@pytest.mark.parametrize(
    "text",
    [
        HEAD + ROWS,
        "\ufeff" + HEAD + ROWS,
        (HEAD + ROWS).replace("\n", "\r\n"),
        "# made by hand\n" + HEAD + "# a pause\n\n" + ROWS,
        HEAD.replace("time", " Time ") + ROWS.replace(",", " , "),
        "note,time,position,force\n" + "".join(f"x,{row}\n" for row in ROWS.split()),
    ],
    ids=["plain", "byte order mark", "CRLF", "comments", "blanks and capitals", "other columns"],
)
def test_a_run_reads_the_same_however_it_was_written(text, tmp_path):
    run = read(tmp_path, text)
    assert run.name == "run.csv"
    np.testing.assert_array_equal(run.time, [0, 0.1, 0.3, 0.4])
    np.testing.assert_array_equal(run.position, [0.1, 0.2, 0.3, 0.5])
    np.testing.assert_array_equal(run.force, [1, 2, np.nan, 4])
    assert run.forced
    assert run.velocity is None


def test_without_a_force_column_none_was_applied(tmp_path):
    run = read(tmp_path, "position,time,velocity\n1,0,5\n2,1,6\n3,2,7\n4,3,8\n")
    assert not run.forced
    np.testing.assert_array_equal(run.force, np.zeros(4))
    np.testing.assert_array_equal(run.velocity, [5, 6, 7, 8])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no header row"),
        (ROWS, "no header row"),
        ("position,force\n1,2\n", "no column 'time'; it has position, force"),
        ("time,force\n1,2\n", "no column 'position'"),
        (HEAD + ROWS.replace("0.2", ""), "line 3: position is empty; only force may be"),
        (HEAD + ROWS.replace("0.2", "soon"), "line 3: position is 'soon'; it must be a number"),
        (HEAD + ROWS.replace("0.2", "nan"), "line 3: position is 'nan'"),
        (HEAD + ROWS.replace("0.2", "inf"), "line 3: position is 'inf'"),
        (HEAD + ROWS.replace("0.3,0.3", "0.1,0.3"), "line 4: time does not increase"),
        (HEAD + ROWS.replace("0.3,0.3", "0.05,0.3"), "line 4: time does not increase"),
        ("time,time,position\n" + ROWS, "line 1: column 'time' is there twice"),
        (HEAD + ROWS.replace(",2\n", "\n"), "line 3: 2 cells, the header has 3 columns"),
        (HEAD + "0,1,2\n1,1,2\n2,1,2\n", "3 samples; a measurement needs at least 4"),
        (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", "run.csv"),
    ],
)
def test_a_file_that_is_no_run_is_refused_with_its_place(text, said, tmp_path):
    with pytest.raises(JodaError) as error:
        read(tmp_path, text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(JodaError, match=r"none\.csv"):
        read_run(tmp_path / "none.csv")


CURVE = "position,force\n0,1\n0.2,1.5\n0.4,2\n0.2,0.5\n"


def measurement(folder, text):
    path = folder / "curve.csv"
    path.write_text(text)
    return read_measurement(path)


def test_a_file_without_time_is_a_quasi_static_curve_in_the_order_measured(tmp_path):
    curve = measurement(tmp_path, "# by hand\n" + CURVE)
    assert isinstance(curve, QuasiStatic)
    assert curve.name == "curve.csv"
    np.testing.assert_array_equal(curve.position, [0, 0.2, 0.4, 0.2])
    np.testing.assert_array_equal(curve.force, [1, 1.5, 2, 0.5])


def test_a_file_with_time_is_a_run(tmp_path):
    run = measurement(tmp_path, HEAD + ROWS)
    assert isinstance(run, Run)
    np.testing.assert_array_equal(run.time, [0, 0.1, 0.3, 0.4])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("position\n1\n2\n3\n4\n", "no column 'force'; it has position, and without time"),
        ("force\n1\n2\n3\n4\n", "no column 'position'; it has force"),
        ("1,2\n3,4\n", "no header row with time and position (or position and force)"),
        (CURVE.replace("0.4,2", "0.4,"), "line 4: force is empty; fill it in or leave the row out"),
        (CURVE.replace("0.4,2", ",2"), "line 4: position is empty"),
        (CURVE.replace("0.4,2", "0.4,high"), "line 4: force is 'high'; it must be a number"),
        ("position,force\n0,1\n1,1\n", "2 samples; a measurement needs at least 4"),
        ("time,force\n1,2\n", "no column 'position'; it has time, force"),
    ],
)
def test_a_file_that_is_neither_is_refused_with_its_place(text, said, tmp_path):
    with pytest.raises(JodaError) as error:
        measurement(tmp_path, text)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_column_that_is_not_there_is_named(tmp_path):
    (tmp_path / "run.csv").write_text("position\n" + "0.1\n" * 5)
    said = r"run\.csv: no column 'force'; it has position, and without time it is a quasi-static"
    with pytest.raises(JodaError, match=said):
        read_measurement(tmp_path / "run.csv")


@pytest.mark.parametrize("every", [2, 3, 8])
def test_a_slower_gauges_force_is_linear_between_its_samples(every):
    time = np.arange(400) / 100
    force = np.sin(3 * time)
    kept = np.where(np.arange(400) % every == 1, force, np.nan)
    run = Run("run.csv", time, 0.1 * time, None, kept, True)
    filled, note = evened(run)
    assert f"one sample of {every}" in note
    assert np.isnan(filled.force).sum() == 0
    np.testing.assert_allclose(filled.force[1 : -every - 1], force[1 : -every - 1], atol=0.01)


def test_a_long_gap_of_a_slower_gauge_stays_unknown():
    time = np.arange(400) / 100
    kept = np.where(np.arange(400) % 3 == 0, 1.0, np.nan)
    kept[100:160] = np.nan
    filled, _ = evened(Run("run.csv", time, 0.1 * time, None, kept, True))
    assert np.isnan(filled.force[105:155]).all()
    assert np.isnan(filled.force).sum() < 70


def test_a_force_that_is_known_nearly_everywhere_is_left_as_it_is():
    time = np.arange(100) / 100
    kept = np.where(np.arange(100) % 10 == 9, np.nan, 1.0)
    run = Run("run.csv", time, 0.1 * time, None, kept, True)
    assert evened(run) == (run, None)


def test_a_force_that_is_known_nowhere_for_long_is_refused():
    time = np.arange(100) / 100
    kept = np.where(np.arange(100) % 6 > 2, np.nan, 1.0)
    with pytest.raises(JodaError, match="nowhere is 'force' filled in for 7 samples"):
        check_known([Run("run.csv", time, 0.1 * time, None, kept, True)])
