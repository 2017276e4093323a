"""``uwbbench new`` and ``uwbbench check``."""

import json

import pytest

from uwbbench.tools.check import all_checks

BROKEN = """\
from uwbbench.api import Params, Stage, ports


class Broken(Stage[Params]):
    \"\"\"Prints, and raises where there is nothing.\"\"\"

    produces = ports("profile")

    def step(self, block):
        print("at work")
        return block.replace(profile=[block.frames.missing])
"""


@pytest.fixture
def broken(install_plugin) -> None:
    install_plugin("broken", {"stages": {"broken": "broken_module:Broken"}}, {"broken_module.py": BROKEN})


def test_a_package_is_written_and_the_next_steps_are_told(uwbbench, tmp_path) -> None:
    out = uwbbench("new", "stage", "clutter.mine", "-o", "plugins").stdout
    assert (tmp_path / "plugins" / "uwbbench-clutter-mine" / "pyproject.toml").is_file()
    for line in ("pip install --editable", "uwbbench check clutter.mine --kind stage", "python -m pytest"):
        assert line in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("new", "stage", "peaks"), "stage 'peaks' is taken by uwbbench"),
        (("new", "term", "mine"), "'term' is not one of"),
        (("new", "stage"), "Missing argument"),
        (("check", "peeks"), "no stage, mapper, detector, dataset or metric named 'peeks'. Did you mean 'peaks'?"),
        (("check", "absent.yaml"), "absent.yaml"),
        (("check", "peaks", "--kind", "metric"), "no metric named 'peaks'"),
        (("check", "peaks", "--only", "same-twiec"), "Did you mean 'same-twice'?"),
        (("check",), "name a plugin to check"),
        (("check", "peaks", "--set", "relative_hight=1"), "relative_hight"),
    ],
)
def test_a_mistake_is_exit_code_2_and_one_message(uwbbench, words, message) -> None:
    assert message in uwbbench(*words, code=2).stderr


def test_nothing_is_overwritten(uwbbench) -> None:
    uwbbench("new", "metric", "mine")
    assert "is there already" in uwbbench("new", "metric", "mine", code=2).stderr


def test_a_plugin_that_conforms_is_exit_code_0(uwbbench) -> None:
    out = uwbbench("check", "recall").stdout
    for one in all_checks("metric"):
        assert one.name in out
    assert "0 failed, 0 error" in out


def test_json_holds_every_check_with_its_status(uwbbench) -> None:
    (found,) = json.loads(uwbbench("check", "recall", "--json").stdout)
    assert (found["kind"], found["name"], found["failed"], found["error"]) == ("metric", "recall", 0, 0)
    assert [one["check"] for one in found["checks"]] == [one.name for one in all_checks("metric")]
    assert all(one["statement"] and one["read_more"] for one in found["checks"])


def test_a_failure_is_exit_code_1_and_explained(uwbbench, broken) -> None:
    words = ("check", "broken", "--only", "produces-what-it-declares", "--only", "imports-are-light")
    out = uwbbench(*words, code=1).stdout
    assert "error produces-what-it-declares: Every port that is declared as produced is there afterwards" in out
    assert "found:     AttributeError: 'Frames' object has no attribute 'missing'" in out
    assert "read more: python -m pydoc uwbbench.api.stage.Stage" in out
    assert "stage 'broken': 1 passed, 0 failed, 1 error, 0 not applicable" in out
    assert "Traceback" not in out
    assert "Traceback" in uwbbench(*words, "--traceback", code=1).stdout


@pytest.mark.slow
def test_json_stays_json_while_a_plugin_prints(uwbbench, broken) -> None:
    found = json.loads(uwbbench("check", "broken", "--json", code=1).stdout)
    assert found[0]["error"] > 10


def test_a_detector_file_is_checked(uwbbench, detector) -> None:
    words = ("check", "simple.yaml", "--only", "detections-have-a-range", "--only", "file-says-what-it-is")
    out = uwbbench(*words, code=1).stdout
    assert "no citation" in out
    assert "1 passed, 1 failed" in out


@pytest.mark.parametrize("kind", ["stage", "mapper", "detector", "dataset", "metric"])
def test_checks_are_listed_with_what_and_why(uwbbench, kind) -> None:
    out = uwbbench("check", "--list", "--kind", kind).stdout
    listed = json.loads(uwbbench("check", "--list", "--kind", kind, "--json").stdout)
    assert [row["check"] for row in listed[kind]] == [one.name for one in all_checks(kind)]
    assert all(row["what and why"] in out for row in listed[kind])
    assert len(listed[kind]) > 20


def test_a_parameter_can_be_given(uwbbench) -> None:
    words = ("check", "filter.range", "--set", "minimum_m=1", "--only", "filters-reject-nan")
    assert "1 passed" in uwbbench(*words).stdout
