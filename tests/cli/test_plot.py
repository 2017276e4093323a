import sys

import pytest

from uwbbench.show.figures.draw import KINDS

TINY_RUN = """\
schema: 1
detectors: [paper, cfar-os]
datasets: [{use: approach, params: {speed_m_s: 3.0}}]
scoring: [frame, peak]
latency: false
stability: false
"""


@pytest.fixture(scope="session")
def run(ran):
    """A run folder; nothing that is drawn changes it."""
    return ran("tiny", TINY_RUN) / "tiny"


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "trajectory"])
def test_each_kind_is_drawn_from_a_capture(uwbbench, capture, kind, tmp_path):
    result = uwbbench("plot", kind, capture, "--detector", "paper", "-o", "made.png")
    assert result.stderr == f"{kind} written to made.png\n"
    assert (tmp_path / "made.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_kinds_without_samples_are_drawn_from_a_run_folder(uwbbench, run, tmp_path):
    for kind in ("properties", "pipeline", "cdf", "map"):
        uwbbench("plot", kind, run, "--detector", "paper", "-o", f"{kind}.svg")
        assert "<svg" in (tmp_path / f"{kind}.svg").read_text("utf-8")
    uwbbench("plot", "cdf", run, "--scoring", "peak", "-o", "all.pdf")
    assert (tmp_path / "all.pdf").read_bytes().startswith(b"%PDF")


def test_without_a_name_the_picture_is_called_after_source_and_kind(uwbbench, capture, tmp_path):
    uwbbench("plot", "radargram", capture)
    assert (tmp_path / "run-radargram.png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["radrgram", "run.h5"], "no kind of plot 'radrgram'. Did you mean 'radargram'?"),
        (["cir", "run.h5"], "give one with --detector"),
        (["cir", "run.h5", "-d", "papr"], "Did you mean 'paper'?"),
        (["cir", "run.h5", "-d", "paper", "--frame", "999"], "has frames 0 to"),
        (["map", "run.h5", "-d", "paper", "--frame", "3"], "--frame is for the kind cir"),
        (["map", "run.h5", "-d", "paper", "--gate-m", "1"], "--gate-m is for the kind cdf and properties"),
        (["cdf", "run.h5", "-d", "paper", "--table", "map"], "'map' is not one of 'filtering', 'mapping'"),
        (["trajectory", "run.h5", "-d", "paper"], "shows what a mapper made of a run: plot it from a run folder"),
        (["cdf", "run.h5", "-d", "paper", "--aligned"], "--aligned is for the kind trajectory and map"),
        (["cdf", "run.h5", "-d", "paper", "--gate-m", "-1"], "gate_m must be positive"),
        (["cdf", "run.h5", "-d", "paper", "-o", "x.jpg"], "expected .png or .svg or .pdf"),
        (["cdf", "run.h5", "-d", "paper", "--capture", "a"], "--capture chooses from a run folder"),
        (["radargram", "run.h5", "--set", "a=1"], "--set changes a detector"),
        (["radargram", "missing.h5"], "missing.h5"),
        (["cdf", "."], "is not a run folder"),
    ],
)
def test_a_mistake_is_one_message(uwbbench, capture, words, message):
    assert message in uwbbench("plot", *words, code=2).stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["cir", "-d", "paper"], "a run folder holds no samples"),
        (["map"], "choose one with --detector: paper, cfar-os"),
        (["properties"], "choose one with --detector: paper, cfar-os"),
        (["map", "-d", "papr"], "has no detector 'papr'. Did you mean 'paper'?"),
        (["map", "-d", "paper", "--capture", "x"], "has no capture 'x'. Known: approach-ch9-metal-1."),
        (["map", "-d", "cfar-os"], "'cfar-os' gives no positions"),
        (["map", "-d", "paper", "--dataset", "aproach"], "has no dataset 'aproach'. Did you mean 'approach'?"),
        (["cdf", "--scoring", "object"], "was not scored by 'object'"),
        (["cdf", "--receiver", "front"], "--receiver is for a capture file"),
    ],
)
def test_a_mistake_about_a_run_is_one_message(uwbbench, run, words, message):
    kind, *options = words
    assert message in uwbbench("plot", kind, run, *options, code=2).stderr


def test_missing_truth_is_one_message(uwbbench, capture_without_truth):
    result = uwbbench("plot", "cdf", capture_without_truth, "-d", "paper", code=2)
    assert "no ground truth" in result.stderr
    uwbbench("plot", "radargram", capture_without_truth, "-d", "paper")


def test_an_empty_capture_is_one_message_for_every_kind(uwbbench, empty_capture):
    for kind in KINDS:
        assert uwbbench("plot", kind, empty_capture, "-d", "paper", code=2).stderr.startswith("error: ")


def test_missing_matplotlib_is_told_with_the_remedy(uwbbench, capture, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = uwbbench("plot", "cdf", capture, "-d", "paper", code=2)
    assert "pip install 'uwbbench[plot]'" in result.stderr
