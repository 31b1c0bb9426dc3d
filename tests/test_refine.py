"""refine: what it needs, and what it says where that is missing."""

import subprocess
import sys
from pathlib import Path

import pytest
from scenes import attached, write

from joda import JodaError, refine

RUN = "time,position\n" + "".join(f"{0.01 * k},{0.3 + 0.001 * k}\n" for k in range(40))
BLOCKED = "import sys\nsys.modules['jax'] = None\n"


def python(code, folder):
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)


def test_importing_joda_does_not_import_jax(tmp_path):
    done = python("import joda, sys; print('jax' in sys.modules)", tmp_path)
    assert done.stdout == "False\n"


def test_without_jax_one_sentence_says_what_to_install(tmp_path):
    attached(tmp_path)
    write(tmp_path, RUN, "run.csv")
    command = ["joda", "refine", "out.xml", "run.csv", "--joint", "door", "-o", "better.xml"]
    code = f"{BLOCKED}sys.argv = {command!r}\nfrom joda.cli import main\nmain()"
    done = python(code, tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert 'pip install ".[mjx]"' in done.stderr
    assert not (tmp_path / "better.xml").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"runs": []}, "no runs"),
        ({"fit": ("values", "shape")}, "'shape' is none of values, intervals"),
        ({"joint": "window"}, "window"),
        ({"model": "in.xml"}, "carries no profile"),
        ({"output": "run.csv"}, "run.csv"),
    ],
)
def test_a_mistake_is_answered_before_any_file_is_written(change, said, tmp_path):
    attached(tmp_path)
    write(tmp_path, RUN, "run.csv")
    arguments = {"model": "out.xml", "joint": "door", "runs": ["run.csv"], "output": "new.xml"}
    arguments |= change
    for key in ("model", "output"):
        arguments[key] = tmp_path / Path(arguments[key])
    arguments["runs"] = [tmp_path / run for run in arguments["runs"]]
    before = sorted(tmp_path.iterdir())
    with pytest.raises(JodaError, match=said):
        refine(**arguments)
    assert sorted(tmp_path.iterdir()) == before
