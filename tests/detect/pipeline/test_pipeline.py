"""The pipeline: checked ports, notes, invalid frames, and a stream that equals the batch."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.detect.pipeline.conftest import CHAIN, assert_same, capture_of, detector
from uwbbench import load_detector
from uwbbench.api import ConfigError, Detections, Trajectory
from uwbbench.detect.pipeline import detector_from_yaml

# Ports.


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (
            ["at_least", "every"],
            "detector 'mine': step 'at_least-0' needs 'amplitude': step 'every-1' makes it, but st",
        ),
        (["every", "after_phase"], "step 'after_phase-1' needs 'pdoa_rad': no step makes it"),
        (["every", "mute", "needs_frames"], "step 'needs_frames-2' needs 'frames'"),
        (["needs_frames"], "no step produces detections"),
    ],
)
def test_a_stage_in_the_wrong_place_is_named_with_what_it_lacks(steps, message):
    with pytest.raises(ConfigError, match=message):
        detector(*steps)


# What captures lack.


def test_a_stage_whose_need_the_capture_lacks_is_refused(approach_without_sts):
    with pytest.raises(ConfigError, match=r"'mine', step 'phase-1': capture 'approach.*' has no STS responses"):
        detector("every", "phase").open(approach_without_sts)


def test_an_optional_stage_is_left_out_with_a_note_and_so_is_what_depends_on_it(approach_without_sts, approach):
    pipeline = detector("every", "phase?", "after_phase?")
    assert pipeline.open(approach_without_sts).notes == (
        "left out, as the capture has no STS responses of two antennas: phase-1, after_phase-2",
    )
    part = dataclasses.replace(approach, name="part")
    stream = pipeline.open(part)
    found = stream.step(approach.frames(0, 3))
    assert "pdoa_rad" in found
    assert found.notes == ("phase was used",)


def test_what_depends_on_a_stage_left_out_must_be_optional_too(approach_without_sts):
    with pytest.raises(ConfigError, match=r"step 'after_phase-2': capture .* has no STS responses"):
        detector("every", "phase?", "after_phase").open(approach_without_sts)


def test_truth_is_shown_to_the_stages_that_need_it_and_missing_truth_is_refused(approach):
    pipeline = detector("known")
    expected = approach.truth.seen_from(approach.radar, approach.trajectory).range_m[:, 0]
    np.testing.assert_array_equal(pipeline.run(approach).range_m, expected)
    with pytest.raises(ConfigError, match="has no ground truth"):
        pipeline.open(dataclasses.replace(approach, truth=None))


def test_parameters_follow_the_channel_and_a_fallback_is_noted():
    text = (
        "schema: 1\nname: a\npipeline:\n  - {use: t.every}\n"
        "  - {use: t.at_least, params: {minimum: {by_channel: {5: 1e9, other: 0}}}}\n"
    )
    capture = capture_of()
    found = detector_from_yaml(text).run(capture)
    assert len(found) == 40
    assert found.notes == ("t.at_least: no minimum for a capture without channel, used 0",)
    on_five = dataclasses.replace(capture, radar=dataclasses.replace(capture.radar, channel=5))
    assert len(detector_from_yaml(text).run(on_five)) == 0


# Invalid and absent frames.


@pytest.mark.parametrize("steps", [["every"], ["every", "late", "meters"]])
def test_invalid_frames_yield_nothing_and_are_not_processed(steps):
    found = detector(*steps).run(capture_of(invalid=(2, 9)))
    expected = [0, 1, 3, 4, 5, 6, 7, 8]
    assert np.unique(found.frame).tolist() == expected
    assert found.processed.tolist() == expected


def test_invalid_frames_reach_no_stage_as_nan():
    found = detector("every", ("at_least", "{minimum: 0}")).run(capture_of(invalid=range(10)), candidates=True)
    assert (len(found), len(found.candidates), found.processed.tolist()) == (0, 0, [])


def test_an_empty_capture_yields_nothing():
    found = detector("every", "late", "meters").run(capture_of(frames=0), candidates=True)
    assert (len(found), len(found.processed)) == (0, 0)


def test_frames_without_detections_count_as_processed():
    found = detector("every", ("at_least", "{minimum: 1e9}")).run(capture_of())
    assert (len(found), found.processed.tolist()) == (0, list(range(10)))


# Stream and batch.


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cuts=st.lists(st.integers(0, 10), max_size=6),
    held=st.integers(0, 12),
    invalid=st.sets(st.integers(0, 9), max_size=3),
    audit=st.booleans(),
)
def test_any_cut_into_blocks_gives_the_answer_of_the_batch(cuts, held, invalid, audit):
    capture = capture_of(invalid=sorted(invalid))
    pipeline = detector(*CHAIN[:2], ("late", f"{{frames: {held}}}"), *CHAIN[2:])
    stream = pipeline.open(capture, audit=audit)
    edges = [0, *sorted(cuts), 10]
    parts = [stream.step(capture.frames(a, b)) for a, b in itertools.pairwise(edges)]
    found = Detections.join([*parts, stream.flush()])
    whole = pipeline.run(capture)
    assert_same(found, whole)
    assert stream.chain == whole.chain


def test_streams_of_one_detector_do_not_share_state():
    pipeline, capture = detector("every", ("late", "{frames: 4}")), capture_of()
    one, two = pipeline.open(capture), pipeline.open(capture)
    one.step(capture.frames(0, 10))
    assert len(two.flush()) == 0
    assert len(one.flush()) == 16


# Names.


def test_the_identity_follows_parameters_and_sources(install_plugin):
    first, same = detector("every", ("at_least", "{minimum: 1}")), detector("every", ("at_least", "{minimum: 1}"))
    assert first.identity == same.identity != detector("every", ("at_least", "{minimum: 2}")).identity


def test_a_detector_is_loaded_from_a_file_with_changes(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("schema: 1\nname: mine\npipeline: [{use: t.every}, {use: t.at_least}]\n")
    found = load_detector(path, changes={"pipeline.t.at_least.params.minimum": 1e9})
    assert len(found.run(capture_of())) == 0
    assert repr(found) == "Pipeline(mine: t.every -> t.at_least)"


# Steps that a file leaves to be understood.


def test_stages_that_a_file_leaves_out_are_put_in_with_a_note(approach):
    short = detector_from_yaml(
        "{schema: 1, name: short, pipeline: [{use: peaks}, {use: filter.prominence, params: {minimum: 0.1}}, "
        "{use: filter.snr, params: {minimum_db: 20}}, {use: range}]}"
    )
    labels = [step.label for step in short.config.steps]
    before_peaks, before_snr = (
        ["profile.minmax", "peaks"],
        ["first_path.crest", "noise_floor", "score.snr", "filter.snr"],
    )
    assert labels == [*before_peaks, "filter.prominence", *before_snr, "range"]
    found = short.run(approach)
    assert np.isfinite(found.range_m).all()
    assert "profile.minmax: put before 'peaks', which needs it, with its defaults" in found.notes


def test_channels_of_a_parameter_may_be_numbers_or_text(approach):
    for key in ("9", "'9'"):
        minimum = f"{{by_channel: {{{key}: 0.2}}}}"
        steps = f"[{{use: peaks}}, {{use: filter.prominence, params: {{minimum: {minimum}}}}}]"
        pipeline = detector_from_yaml(f"{{schema: 1, name: a, pipeline: {steps}}}")
        assert pipeline.config.steps[-1].params_for(9) == ({"minimum": 0.2}, [])


def test_an_empty_table_has_the_columns_of_a_full_one(approach):
    paper = load_detector("paper")
    nothing = dataclasses.replace(
        approach,
        trajectory=Trajectory(np.empty(0), np.empty((0, 3)), np.empty(0)),
        **{name: getattr(approach, name)[:0] for name in ("preamble", "sts1", "sts2")},
        **{
            name: getattr(approach, name)[:0]
            for name in ("first_path_index", "first_path_index_sts1", "first_path_index_sts2")
        },
    )
    assert set(paper.run(nothing).columns) == set(paper.run(approach).columns)
