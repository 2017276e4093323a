"""Every detector in configs/detectors, on the built-in approach and on the measured rail."""

import dataclasses
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_limits

from tests.fixtures.chance import seed
from tests.fixtures.shipped import NAMES, ON_A_PLATE, sparing
from uwbbench import load_detector
from uwbbench.api import Capture, ConfigError, Detections
from uwbbench.config.source import open_dataset
from uwbbench.measure.accuracy.scoring import Region, score

FRAMES = 150
EXPECTED = {
    "paper",
    "paper-filtering",
    "paper-metal",
    "paper-concrete",
    "paper-plywood",
    "paper-as-printed",
    "cfar-ca",
    "cfar-os",
    "background-mean",
    "background-ema",
    "background-svd",
    "background-cfar-kalman",
    "entropy",
    "walker-rpca",
    "walker-svd",
    "dwt-lstm",
    "dwt-bilstm",
    "null",
    "constant",
    "oracle",
}


@cache
def plate(**params: object) -> Capture:
    """A plate approached from 1.6 m in 150 frames: near enough to stand above any ringing of the chassis."""
    dataset = open_dataset("approach", {"start_m": 1.6, "speed_m_s": 0.321, "seed": seed(), **params}, ())
    return dataset.open(dataset.names()[0])


@cache
def whole_run(name: str, sts: bool = True) -> Detections:
    return load_detector(name).run(plate(sts=sts))


def hits(found: Detections, capture: Capture, gate_m: float = 0.20) -> np.ndarray:
    """Whether the strongest detection of each frame that has one is within the gate of the plate."""
    true_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    order = np.lexsort((-found["amplitude"], found.frame))
    frame, first = np.unique(found.frame[order], return_index=True)
    return np.abs(found.range_m[order][first] - true_m[frame]) <= gate_m


def test_the_promised_detectors_are_shipped():
    assert set(NAMES) >= EXPECTED


@pytest.mark.parametrize("name", NAMES)
def test_every_detector_says_what_it_is(name):
    config = load_detector(name).config
    assert config.name == name
    assert config.description
    assert config.citation


@pytest.mark.parametrize("sts", [True, False])
@pytest.mark.parametrize("name", ON_A_PLATE)
def test_every_detector_runs_and_looks_at_every_frame(name, sts):
    found = whole_run(name, sts)
    np.testing.assert_array_equal(found.processed, np.arange(FRAMES))
    assert (len(found) > 0) == (name != "null")


@pytest.mark.parametrize("sts", [True, False])
@pytest.mark.parametrize("name", sparing(ON_A_PLATE))
@given(cuts=st.lists(st.integers(0, FRAMES), max_size=12))
@example(cuts=list(range(1, FRAMES)))
@settings(max_examples=3, deadline=None)
def test_stream_equals_batch_for_any_cut_into_blocks(name, sts, cuts):
    capture, whole = plate(sts=sts), whole_run(name, sts)
    stream = load_detector(name).open(capture)
    parts = [stream.step(capture.frames(start, stop)) for start, stop in pairwise([0, *sorted(cuts), FRAMES])]
    joined = Detections.join([*parts, stream.flush()])
    assert joined.columns.keys() == whole.columns.keys()
    for column, values in whole.columns.items():
        np.testing.assert_array_equal(joined[column], values, err_msg=column)
    np.testing.assert_array_equal(joined.processed, whole.processed)
    assert stream.notes == whole.notes


@pytest.mark.parametrize("name", sorted(EXPECTED - {"null", "constant", "oracle", "paper-concrete"}))
def test_strongest_detection_is_the_metal_plate(name):
    found, capture = whole_run(name), plate()
    near = hits(found, capture, gate_m=0.40 if name == "paper-as-printed" else 0.20)
    assert len(near) > 0.6 * FRAMES
    assert near.mean() > 0.9


def test_paper_finds_the_plate_in_range_azimuth_and_place():
    capture = plate(seed=1)  # of these figures: other ringing hides the plate in other frames
    found = load_detector("paper").run(capture)
    sight = capture.truth.seen_from(capture.radar, capture.trajectory)
    error_m = np.abs(found.range_m - sight.range_m[found.frame, 0])
    assert hits(found, capture).sum() > 0.9 * FRAMES
    assert 0.02 < error_m.mean() < 0.12
    off_rad = found.azimuth_rad - sight.azimuth_rad[found.frame, 0]
    assert np.abs(np.median(off_rad)) < np.deg2rad(2)
    clustered = found.take(found["cluster"] >= 0)
    assert len(clustered) > 0.8 * FRAMES
    points_m = np.stack([clustered["x_m"], clustered["y_m"]], axis=1)
    assert capture.truth.distance_to(points_m, clustered.frame).mean() < 0.15


def test_paper_without_sts_gives_ranges_and_says_what_it_left_out():
    found = whole_run("paper", sts=False)
    (left_out,) = [note for note in found.notes if "left out" in note]
    reason, _, names = left_out.partition(": ")
    assert names.split(", ") == ["pdoa", "filter.pdoa", "azimuth", "position", "dbscan"]
    assert "STS" in reason
    assert "cluster" not in found
    assert hits(found, plate(sts=False)).mean() > 0.9


def test_paper_leaves_nothing_out_where_sts_is_there():
    assert not any("left out" in note for note in whole_run("paper").notes)


PUBLISHED = {
    5: {"width.params.minimum": 1.0, "prominence.params.minimum": 0.05, "snr.params.minimum_db": 20.0},
    9: {"width.params.minimum": 0.2, "prominence.params.minimum": 0.03, "snr.params.minimum_db": 10.0},
}


@pytest.mark.parametrize(("channel", "other"), [(5, 9), (9, 5)])
def test_paper_takes_the_thresholds_of_the_captures_channel(channel, other):
    def ranges_m(thresholds):
        changes = {f"pipeline.filter.{key}": value for key, value in thresholds.items()}
        changes["pipeline.select.strongest.use"] = "select.all"
        return load_detector("paper", changes=changes).run(plate(channel=channel, material="plywood")).range_m

    np.testing.assert_array_equal(ranges_m({}), ranges_m(PUBLISHED[channel]))
    assert len(ranges_m({})) != len(ranges_m(PUBLISHED[other]))  # 5 to 200 and 30 to 200 of them, 10 more for channel 9


def test_paper_takes_strong_ringing_for_a_far_plate_and_clutter_removal_does_not():
    # The ringing of one robot in six is strong enough: none of 200 is, once in 1e15.
    far = (plate(start_m=3.4, speed_m_s=0.9, seed=seed(number)) for number in range(200))
    ringing = next(one for one in far if hits(load_detector("paper").run(one), one)[:50].mean() < 0.2)
    assert hits(load_detector("background-mean").run(ringing), ringing)[5:50].mean() > 0.8


@pytest.mark.parametrize(
    ("name", "channel", "expected"),
    [
        ("paper", 5, (1.0, 0.05, 20.0)),
        ("paper", 9, (0.20, 0.03, 10.0)),
        ("paper", None, (0.20, 0.03, 10.0)),
        ("paper-filtering", 5, (1.0, 0.05, 20.0)),
        ("paper-filtering", 9, (0.20, 0.03, 10.0)),
        ("paper-metal", 5, (1.0, 0.04, 25.0)),
        ("paper-metal", 9, (1.0, 0.05, 20.0)),
        ("paper-concrete", 5, (1.0, 0.05, 20.0)),
        ("paper-concrete", 9, (2.0, 0.03, 10.0)),
        ("paper-plywood", 5, (1.0, 0.02, 15.0)),
        ("paper-plywood", 9, (0.10, 0.01, 10.0)),
    ],
)
def test_thresholds_are_the_published_ones(name, channel, expected):
    steps = {step.label: step.params_for(channel)[0] for step in load_detector(name).config.steps}
    found = (
        steps["filter.width"]["minimum"],
        steps["filter.prominence"]["minimum"],
        steps["filter.snr"]["minimum_db"],
    )
    assert found == expected


def test_filtering_half_is_the_paper_without_its_mapping():
    paper, half = load_detector("paper").config.steps, load_detector("paper-filtering").config.steps
    mapping = {"azimuth", "position", "dbscan"}
    assert list(half) == [step for step in paper if step.use not in mapping]


def test_printed_form_subtracts_the_printed_offsets():
    steps = {step.label: step for step in load_detector("paper-as-printed").config.steps}
    for channel, offset_rad in ((5, 0.0522), (9, 0.0209)):
        assert np.deg2rad(steps["azimuth"].params_for(channel)[0]["bias_deg"]) == pytest.approx(offset_rad, abs=1e-8)
    assert steps["range"].params["bias_m"] == "paper"


def test_printed_form_follows_every_letter_that_paper_does_not():
    paper, printed = (
        {step.label: step.params for step in load_detector(name).config.steps} for name in ("paper", "paper-as-printed")
    )
    different = {
        label: {k: v for k, v in params.items() if paper[label].get(k) != v} for label, params in printed.items()
    }
    del different["azimuth"]
    assert {label: params for label, params in different.items() if params} == {
        "score.snr": {"delay_unit": "samples"},
        "pdoa": {"phase": "arctan"},
        "range": {"geometry": "paper", "bias_m": "paper", "speed_of_light": "rounded", "tap_ns": 1.0},
        "dbscan": {"when": "exceeded"},
    }


@pytest.mark.parametrize("name", sorted(EXPECTED - {"null", "constant", "oracle"}))
def test_frames_without_a_signal_yield_nothing(name):
    capture = plate()
    stream = load_detector(name).open(capture)
    frames = capture.frames(0, 80)
    blank = {part: np.zeros_like(getattr(frames, part)) for part in ("preamble", "sts1", "sts2")}
    silent = frames.__class__(**{**{k: v for k, v in vars(frames).items() if k != "amplitude"}, **blank})
    assert len(Detections.join([stream.step(silent), stream.flush()])) == 0


@pytest.mark.parametrize("name", ["cfar-ca", "cfar-os"])
def test_cfar_keeps_its_false_alarms_rare_on_a_radar_without_a_channel(name):
    capture = plate()
    bare = dataclasses.replace(capture, radar=dataclasses.replace(capture.radar, channel=None))
    found = score(load_detector(name).run(bare), bare, "object").filtering
    assert found.retained < 1.2 * found.frames, "thresholds were ten times bolder here, with three detections a frame"
    assert found.precision > 0.9


def test_oracle_is_exact_and_constant_is_not():
    capture = plate()
    assert hits(whole_run("oracle"), capture, gate_m=1e-9).all()
    assert hits(whole_run("constant"), capture).mean() < 0.5


@pytest.fixture(scope="module")
def rail(data_dir):
    """The measured PulsON capture, its moving frames."""
    dataset = open_dataset("pulson440-rail", {"frames": "moving"}, [data_dir])
    return dataset.open(dataset.names()[0])


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("background-mean", {}),
        ("background-ema", {}),
        ("background-svd", {}),
        # A rate at which a tenth of all taps are alarms: with two a frame looked at, the reflectors are among them.
        ("cfar-ca", {"pipeline.cfar.ca.params.false_alarm_rate": 0.1}),
        ("cfar-os", {"pipeline.cfar.os.params.false_alarm_rate": 0.1}),
    ],
)
def test_two_strongest_detections_find_the_reflectors_of_the_measured_rail(name, changes, rail):
    with threadpool_limits(1):  # threads only contend over matrices as small as these
        found = load_detector(name, changes=changes).run(rail)
    filtering = score(found, rail, "object", 0.20, Region(6.0, 10.0), strongest=2).filtering
    assert filtering.recall >= 0.75
    assert filtering.matched_mae_m <= 0.04
    assert filtering.chance_recall < 0.25


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "least_tree", "least_walk"),
    [("background-mean", 12, 0.75), ("background-ema", 10, 0.75), ("cfar-ca", 7, 0.7), ("cfar-os", 6, 0.7)],
)
def test_settings_hold_on_other_recordings_of_such_radars(name, least_tree, least_walk, data_dir):
    """Chance finds the tree at one stop of 23 and the person in 0.12 of the frames."""
    tree = open_dataset("pulson440-tree", {}, [data_dir]).open("trial_1")
    found = score(load_detector(name).run(tree), tree, "object", 0.20, Region(4.5, 12.0), strongest=1).filtering
    assert found.tp >= least_tree
    walk = open_dataset("et4173-walk", {}, [data_dir])
    for node, share in (("101", least_walk), ("102", least_walk - 0.15)):
        capture = walk.open(node)
        assert score(load_detector(name).run(capture), capture, "frame", 0.30).filtering.recall >= share


@pytest.mark.data
def test_printed_form_names_the_channels_it_knows(rail):
    with pytest.raises(ConfigError, match="channels 5, 9"):
        load_detector("paper-as-printed").open(rail)
