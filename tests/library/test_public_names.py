"""The names of ``uwbbench`` itself: listed, quick to import, and callable whatever was imported before."""

import pickle
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import uwbbench

CHECKED = """
import inspect
assert "experiment" in inspect.signature(uwbbench.run).parameters
from uwbbench.api.errors import ConfigError
try:
    uwbbench.run({"detectors": ["papr"], "datasets": [{"use": "approach"}]})
except ConfigError as error:
    assert "paper" in str(error)
else:
    raise AssertionError("an unknown detector was run")
"""


def python(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=folder, capture_output=True, text=True, check=False
    )


def test_dir_lists_the_public_names():
    assert dir(uwbbench) == sorted(uwbbench.__all__)


@pytest.mark.parametrize("name", uwbbench.__all__)
def test_every_public_name_is_there(name):
    assert getattr(uwbbench, name) is not None


def test_a_name_that_does_not_exist_is_refused():
    with pytest.raises(AttributeError, match="has no attribute 'ran'"):
        uwbbench.ran  # noqa: B018


@pytest.mark.parametrize(
    "imports",
    [
        "import uwbbench",
        pytest.param("import uwbbench.run.execute\nimport uwbbench", marks=pytest.mark.slow),
        "import uwbbench\nbefore = uwbbench.run\nimport uwbbench.run.execute\nassert before is uwbbench.run",
        *(
            pytest.param(order, marks=pytest.mark.slow)
            for order in (
                "from uwbbench.run import run_experiment\nimport uwbbench",
                "import uwbbench.cli\nimport uwbbench.run.experiment as room\nassert room\nimport uwbbench",
                "from uwbbench import run\nimport uwbbench\nimport uwbbench.run.folder\nassert run is uwbbench.run",
                "import importlib\nimportlib.import_module('uwbbench.run')\nimport uwbbench",
                "import uwbbench\nuwbbench.run\nfrom uwbbench.run.execute import run_experiment",
            )
        ),
    ],
)
def test_run_can_be_called_in_whatever_order_things_are_imported(imports, tmp_path):
    done = python(f"{imports}\n{CHECKED}", tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_room_of_that_name_is_still_a_package(tmp_path):
    done = python(
        """
        import uwbbench, uwbbench.run.execute, types
        assert isinstance(uwbbench.run, types.ModuleType)
        assert uwbbench.run.run_experiment is uwbbench.run.execute.run_experiment
        """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("pickler", ["pickle", "cloudpickle"])
def test_the_package_and_its_room_are_pickled_by_name(pickler):
    dumps = pytest.importorskip(pickler).dumps
    for module in (uwbbench, uwbbench.run):
        assert pickle.loads(dumps(module)) is module  # noqa: S301 - our own


def test_importing_the_package_imports_nothing_heavy(tmp_path):
    done = python(
        """
        import sys, uwbbench
        dir(uwbbench)
        heavy = {"numpy", "pandas", "numba", "pydantic", "uwbbench.run", "uwbbench.tools"} & set(sys.modules)
        assert not heavy, heavy
        """,
        tmp_path,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_type_checker_sees_the_function(tmp_path):
    (tmp_path / "user.py").write_text(
        textwrap.dedent(
            """
            import uwbbench
            import uwbbench.run.execute
            from uwbbench.run import run_experiment

            def best(folder: str) -> str:
                run = uwbbench.run("demo", out=folder, jobs=1)
                uwbbench.leaderboard([run, uwbbench.open_run(folder)])
                reveal_type(run)
                return str(run.leaderboard["detector"].iloc[0])

            uwbbench.run("demo", jobz=1)
            """
        )
    )
    root = Path(__file__).parents[2]
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", root / ".mypy_cache", "user.py"]
    pytest.importorskip("mypy")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    errors = [line for line in done.stdout.splitlines() if "user.py" in line and "error:" in line]
    assert "uwbbench.tools.stored_run.Run" in done.stdout, done.stdout
    assert len(errors) == 1, errors
    assert 'Unexpected keyword argument "jobz"' in errors[0]


def test_the_package_can_be_run_as_a_module(tmp_path):
    command = [sys.executable, "-m", "uwbbench", "--version"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"uwbbench {uwbbench.__version__}"


def test_the_package_has_no_more_than_twelve_entries():
    entries = [path.name for path in Path(uwbbench.__file__).parent.iterdir() if path.name != "__pycache__"]
    assert len(entries) <= 12, sorted(entries)
