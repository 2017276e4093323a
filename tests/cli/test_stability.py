"""``uwbbench stability``."""

import json

import pytest

from uwbbench.measure.robustness import all_cases

BLIND = """\
schema: 1
name: blind
pipeline:
  - {use: first_path.crest}
  - {use: profile.amplitude}
  - {use: peaks}
  - {use: range}
"""


@pytest.mark.slow
def test_all_cases_are_told_for_people(uwbbench) -> None:
    out = uwbbench("stability", "--detector", "paper-filtering").stdout
    for case in all_cases():
        assert case.name in out
        assert f"{case.expectation}: {case.statement}" in out
    assert "0 failed" in out
    for line in ("largest error:", "echo found:", "changed by float32:", "changed by one ulp:"):
        assert line in out


@pytest.mark.slow
def test_json_holds_the_figures_and_every_case(uwbbench) -> None:
    found = json.loads(uwbbench("stability", "-d", "cfar-os", "--json").stdout)
    assert found["detector"] == "cfar-os"
    assert [one["case"] for one in found["cases"]] == [case.name for case in all_cases()]
    statuses = [one["status"] for one in found["cases"]]
    assert found["passed"] == statuses.count("passed") > 30
    assert found["not_applicable"] == statuses.count("not applicable")
    assert found["failed"] == 0
    assert 0 <= found["flips_float32"] <= 0.01
    assert 0 <= found["flips_one_ulp"] <= 0.01
    assert 0 < found["largest_error_m"] < 1e-9
    assert found["usual_hits"] > 0.9


def test_a_detector_that_computes_nothing_has_no_errors(uwbbench) -> None:
    found = json.loads(uwbbench("stability", "-d", "null", "--json").stdout)
    for figure in ("largest_error_ulp", "flips_float32", "flips_one_ulp"):
        assert found[figure] is None
    assert "n/a ulp" in uwbbench("stability", "-d", "null").stdout


def test_single_cases_can_be_chosen(uwbbench) -> None:
    words = ("stability", "-d", "cfar-os", "--json", "--case", "nan-frames", "--case", "zero-frames")
    found = json.loads(uwbbench(*words).stdout)
    assert [one["case"] for one in found["cases"]] == ["nan-frames", "zero-frames"]
    assert found["flips_float32"] is None


@pytest.mark.slow
def test_a_failed_case_is_exit_code_1_and_still_told(uwbbench, tmp_path) -> None:
    (tmp_path / "blind.yaml").write_text(BLIND)
    words = ("stability", "-d", "blind.yaml", "--case", "rippled-constant-frames")
    assert "detections of rounding errors" in uwbbench(*words, code=1).stdout
    assert json.loads(uwbbench(*words, "--json", code=1).stdout)["failed"] == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-d", "papre"), "Did you mean 'paper'?"),
        (("-d", "paper", "--case", "zero-frame"), "no hard case named 'zero-frame'. Did you mean 'zero-frames'?"),
        (("-d", "paper", "--set", "pipeline.peaks.params.depth=1"), "depth"),
        ((), "--detector"),
    ],
)
def test_a_mistake_is_exit_code_2_and_one_message(uwbbench, words, message) -> None:
    assert message in uwbbench("stability", *words, code=2).stderr


def test_a_detector_that_cannot_run_on_the_capture_says_why(uwbbench) -> None:
    words = ("stability", "-d", "cfar-ca", "--set", "pipeline.cfar.ca.params.training_taps=64")
    assert "training_taps" in uwbbench(*words, code=2).stderr
