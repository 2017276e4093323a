"""``uwbbench time``. Nothing here asserts how long anything takes."""

import json

import pytest

from uwbbench.tools import warmup

APPROACH = "approach[approach-ch9-metal-1]"


@pytest.mark.slow
def test_json_holds_every_number_and_every_call(uwbbench, capture, detector) -> None:
    words = ("time", capture, "-d", detector, "-d", "null", "--reference", "null", "--json")
    found = json.loads(uwbbench(*words, "--paced", 0.2, "--rate-hz", 100, "--blocks", 40).stdout)
    assert (found["capture"], found["source"], found["frames"]) == ("approach-ch9-metal-1", "simulated", 39)
    assert [one["detector"] for one in found["detectors"]] == ["simple", "null"]
    for one in found["detectors"]:
        assert one["timed"] == "samples to rows"
        assert len(one["times_us"]) == len(one["step_us"]) == one["n"] == 39
        assert len(one["paced_times_us"]) == one["paced"]["n"] == 20
        assert one["ratio_to_reference"]["reference"] == "null"
        assert one["ratio_to_reference"]["blocks"] >= 40
        assert one["threads"] == 1
        assert one["p90_us"] is not None
        assert one["p95_us"] is None
        assert {"versions", "cpu", "cores", "governor"} <= set(one["machine"])


@pytest.mark.slow
def test_people_see_the_ratio_first_and_that_times_hold_here_only(uwbbench, capture, detector) -> None:
    result = uwbbench("time", capture, "-d", detector, "--paced", 0.1)
    out = result.stdout
    assert "SIMULATED capture 'approach-ch9-metal-1', 39 frames" in out
    assert out.index("time relative to paper-filtering") < out.index("THIS MACHINE ONLY") < out.index("p50")
    for line in (
        "typical block",
        "missed deadlines",
        "clustering calls",
        "at 48 Hz for 0.1 s",
        "step alone, p50",
        "age of the answers",
        "a detector that does nothing",
    ):
        assert line in out
    assert "n/a (too few calls)" in out
    assert "timing simple" in result.stderr


@pytest.mark.slow
def test_a_capture_of_a_dataset_is_named_in_brackets(uwbbench) -> None:
    found = json.loads(uwbbench("time", APPROACH, "-d", "null", "--reference", "null", "--frames", 30, "--json").stdout)
    assert found["capture"] == "approach-ch9-metal-1"
    (one,) = found["detectors"]
    assert one["n"] == found["frames"] == 30
    assert any(note.startswith("timed the first 30 of ") for note in one["notes"])


@pytest.mark.slow
def test_one_receiver_of_several_is_timed(uwbbench, two_receivers) -> None:
    words = ("time", two_receivers, "-d", "null", "--reference", "null")
    assert "rear" in uwbbench(*words, code=2).stderr
    assert json.loads(uwbbench(*words, "--receiver", "rear", "--json").stdout)["detectors"][0]["n"] == 39


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run.h5",), "--detector"),
        (("run.h5", "-d", "papre"), "Did you mean 'paper'?"),
        (("run.h5", "-d", "null", "--reference", "papre"), "Did you mean 'paper'?"),
        (("run.h5", "-d", "null", "--rate-hz", 10), "--rate-hz is the rate of --paced"),
        (("run.h5", "-d", "null", "--blocks", 7), "--blocks"),
        (("run.h5", "-d", "null", "--paced", 0), "--paced"),
        (("run.h5", "-d", "null", "--data-dir", "."), "run.h5 is a capture file"),
        (("gone.h5", "-d", "null"), "gone.h5"),
        ((APPROACH, "-d", "null", "--receiver", "rear"), "names a capture of a dataset"),
        (("aproach[approach-ch9-metal-1]", "-d", "null"), "Did you mean 'approach'?"),
        (("approach[approach-ch9-metal]", "-d", "null"), "approach-ch9-metal"),
    ],
)
def test_a_mistake_is_exit_code_2_and_one_message(uwbbench, capture, words, message) -> None:
    assert message in uwbbench("time", *words, code=2).stderr


def test_a_detector_that_cannot_run_on_the_capture_is_told_before_anything_is_timed(
    uwbbench, capture, tmp_path
) -> None:
    text = "schema: 1\nname: wide\nextends: cfar-ca\nset: {pipeline.cfar.ca.params.training_taps: 64}\n"
    (tmp_path / "wide.yaml").write_text(text)
    err = uwbbench("time", capture, "-d", "null", "-d", "wide.yaml", code=2).stderr
    assert "training_taps" in err
    assert "timing" not in err


def test_a_capture_without_frames_is_a_mistake(uwbbench, empty_capture) -> None:
    assert "has no frames" in uwbbench("time", empty_capture, "-d", "null", code=2).stderr


@pytest.mark.slow
def test_all_detectors_that_can_work_on_a_capture_are_one_line_each(
    uwbbench, capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warmup, "installed_detectors", lambda: ["paper-filtering", "constant", "gone.yaml"])
    result = uwbbench("time", capture, "--all", "-d", "null", "--frames", 10, "--blocks", 8)
    lines = [line.split() for line in result.stdout.splitlines()]
    assert [line[0] for line in lines if line and line[0] in ("null", "paper-filtering", "constant")] == [
        "null",
        "paper-filtering",
        "constant",
    ]
    assert "rows / paper-filtering" in " ".join(result.stdout.split())
    assert "note: not timed: gone.yaml: no such file" in result.stderr


def test_without_a_detector_one_is_asked_for(uwbbench, capture) -> None:
    assert "name one with --detector, or give --all" in uwbbench("time", capture, code=2).stderr
