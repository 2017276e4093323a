"""What a notebook shows: hooks are called as Jupyter calls them, and the markup is read back by a parser."""

import dataclasses
import re
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import uwbbench
from uwbbench.api import Capture, Detections, Obstacle, Truth, load_plugin
from uwbbench.api.locate import shipped
from uwbbench.api.text import one_line
from uwbbench.detect.pipeline import detector_from_yaml
from uwbbench.show.notebook import elements

HOSTILE = "<script>alert(1)</script>\"'&\n\x00" + "x" * 10_000
VOID = {"image", "br"}


class _Markup(HTMLParser):
    """Text, tags and attributes of markup whose tags must close in order."""

    def __init__(self, markup: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(markup)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] != ["style"]:
            self.text += f"{data} "

    def attributes(self, name):
        return [attrs[name] for _, attrs in self.tags if name in attrs]


def shown(thing) -> _Markup:
    return _Markup(thing._repr_html_())


@pytest.fixture(scope="module")
def found(approach):
    return uwbbench.load_detector("paper").run(approach)


def test_a_plain_repr_is_one_line(approach, found):
    scores = uwbbench.score(found, approach)
    things = (approach, approach.header, approach.truth, found, scores, uwbbench.load_detector("paper"))
    for thing in things:
        assert "\n" not in repr(thing)
        assert len(repr(thing)) < 400


def test_a_capture_shows_radar_frames_truth_and_licence(approach):
    text = shown(approach).text
    for words in (approach.name, "SIMULATED", "channel 9", f"{len(approach)} of", "exhaustive", approach.license):
        assert words in text


def test_a_capture_shows_its_samples_and_the_true_range_without_anything_loaded_from_elsewhere(approach):
    markup = shown(approach)
    (image,) = markup.attributes("href")
    assert image.startswith("data:image/png;base64,")
    assert len([tag for tag, _ in markup.tags if tag == "path"]) == 1
    assert not markup.attributes("src")


def test_the_line_of_the_truth_breaks_where_the_object_is_hidden(approach):
    outline = np.array([[2.0, -3.0], [2.0, 3.0]])  # a screen between the plate and the receiver
    screen = Obstacle("screen", "cloth", outline, structure=True)
    hidden = dataclasses.replace(approach, truth=Truth((*approach.truth.objects, screen)))
    (whole,) = [attrs["d"] for tag, attrs in shown(approach).tags if tag == "path"]
    seen = [attrs["d"] for tag, attrs in shown(hidden).tags if tag == "path"]
    assert sum(len(path) for path in seen) < len(whole)


def test_a_header_shows_no_picture(approach):
    assert not shown(approach.header).attributes("href")


def test_a_capture_without_truth_says_that_it_cannot_be_scored(approach):
    assert "not scored" in shown(dataclasses.replace(approach, truth=None)).text


def test_a_capture_without_frames_is_shown(approach):
    trajectory = type(approach.trajectory)(np.empty(0), np.empty((0, 3)), np.empty(0))
    bare = {"first_path_index": np.empty(0), "first_path_index_sts1": None, "first_path_index_sts2": None}
    names = ("preamble", "sts1", "sts2")
    samples = {name: None if getattr(approach, name) is None else getattr(approach, name)[:0] for name in names}
    empty = dataclasses.replace(approach, trajectory=trajectory, truth=None, **samples, **_given(approach, bare))
    assert "no frames" in shown(empty).text


def _given(capture, bare):
    return {name: value for name, value in bare.items() if getattr(capture, name) is not None}


def test_damaged_samples_leave_a_sentence_in_place_of_the_picture(approach):
    class Damaged:
        shape = approach.preamble.shape

        def __getitem__(self, key):
            raise OSError("checksum")

    text = shown(dataclasses.replace(approach, preamble=Damaged())).text
    assert "damaged file" in text
    assert approach.license in text


def test_truth_lists_objects_with_material_and_place():
    truth = Truth(
        (Obstacle("post", "steel", np.array([[1.0, 2.0]])), Obstacle("wall", "plaster", np.zeros((2, 2)), True))
    )
    text = shown(truth).text
    for words in ("post", "steel", "(1.00, 2.00) m", "structure", "obstacle"):
        assert words in text


def test_many_objects_are_counted_not_listed():
    things = tuple(Obstacle(f"post {n}", "steel", np.zeros((1, 2))) for n in range(1000))
    text = shown(Truth(things)).text
    assert "1000 objects" in text
    assert "980 more objects" in text
    assert "post 999" not in text


def test_detections_show_units_rows_processed_frames_and_notes(found):
    text = shown(found.annotated(notes=["look here"])).text
    for words in ("range (m)", "delay (ns)", "azimuth (deg)", f"{len(found.processed)} processed", "look here"):
        assert words in text
    assert f"{found.range_m[0]:.3f}" in text
    assert f"{found['delay_s'][0] * 1e9:.2f}" in text


def test_empty_detections_tell_frames_that_were_looked_at():
    assert "7 processed, 7 of them without a detection" in shown(Detections.empty(np.arange(7))).text


def test_unknown_numbers_are_not_shown_as_nan():
    text = shown(Detections([0], range_m=[np.nan])).text
    assert "n/a" in text
    assert "nan" not in text


def test_scores_show_each_number_with_n_and_interval(approach, found):
    scores = uwbbench.score(found, approach)
    text = shown(scores).text
    assert f"{scores.recall:.3f}" in text
    assert f"{scores.retained} detections" in text
    assert f"{scores.frames} frames" in text
    assert "the recording is shorter than 30 s" in text


def test_scores_show_both_tables_where_positions_are_clustered(approach, found):
    text = shown(uwbbench.score(found, approach)).text
    assert "after filtering" in text
    assert "after mapping" in text


def test_too_few_blocks_give_no_interval_and_a_reason(approach, found):
    short = dataclasses.replace(_cut(approach, 100))
    scores = uwbbench.score(uwbbench.load_detector("paper-filtering").run(short), short)
    assert "shorter than 30 s" in shown(scores).text


def _cut(capture: Capture, frames: int) -> Capture:
    track = capture.trajectory
    part = type(track)(track.timestamp_s[:frames], track.position_m[:frames], track.yaw_rad[:frames])
    names = (
        "preamble", "sts1", "sts2", "first_path_index", "first_path_index_sts1", "first_path_index_sts2",
        "odometry_position_m", "odometry_yaw_rad",
    )  # fmt: skip
    kept = {name: getattr(capture, name) for name in names}
    return dataclasses.replace(
        capture, trajectory=part, **{name: None if value is None else value[:frames] for name, value in kept.items()}
    )


def test_a_detector_shows_its_chain_with_parameters_and_what_is_optional():
    markup = shown(uwbbench.load_detector("paper"))
    for words in ("noise_floor", "gain_db_per_ns", "0.2", "set", "default", "channel 5: 0.05", "optional:"):
        assert words in markup.text
    steps = [attrs for tag, attrs in markup.tags if tag == "details"]
    assert len(steps) == 16
    assert {"class": "optional"} in steps


def test_a_step_that_was_put_in_says_for_what():
    found = detector_from_yaml("{schema: 1, name: short, pipeline: [{use: peaks}]}")
    assert "inserted for peaks" in shown(found).text


def test_names_are_escaped_and_cut(approach):
    truth = Truth((Obstacle(HOSTILE, HOSTILE, np.zeros((1, 2))),))
    capture = dataclasses.replace(approach, name=HOSTILE, license=HOSTILE, description=HOSTILE, truth=truth)
    detector = detector_from_yaml("{schema: 1, name: short, pipeline: [{use: peaks}]}")
    named = type(detector)(dataclasses.replace(detector.config, name=HOSTILE, description=HOSTILE))
    notes = Detections([0], processed=[0], notes=[HOSTILE], **{HOSTILE: [1.0]})
    for thing in (capture, truth, named, notes):
        markup = shown(thing)
        assert "script" not in {tag for tag, _ in markup.tags}
        assert "<script>" in markup.text
        assert "x" * 1000 not in markup.text


@given(st.text())
def test_any_text_reads_back_as_one_line_of_itself(value):
    read = _Markup(f"<p>{elements.text(value)}</p>").text
    assert read.split() == one_line(value, elements.LONGEST).split()


def test_nothing_shows_the_markup_of_docstrings(approach, found):
    detectors = [uwbbench.load_detector(name) for name in shipped("detectors")]
    uses = {step.use for detector in detectors for step in detector.config.steps}
    assert any("`" in (load_plugin("stages", use).__doc__ or "").partition("\n")[0] for use in uses)
    for thing in (approach, approach.header, approach.truth, found, uwbbench.score(found, approach), *detectors):
        assert not re.search(r"`|:\w+:|\*\*|\n[-=]{3}", shown(thing).text), thing


def test_a_picture_needs_no_matplotlib(approach, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert shown(approach).attributes("href")
