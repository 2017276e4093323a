"""The pipeline: checked ports, notes, invalid frames, the audit, and a stream that equals the batch."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench import load_detector
from uwbbench.api import Capture, ConfigError, Detections, Radar, Trajectory
from uwbbench.detect.pipeline import detector_from_yaml

STAGES = '''
import numpy as np
from pydantic import Field
from uwbbench.api import Block, Detections, Filter, Params, Stage, ports


class Every(Stage[Params]):
    """Every tap of every frame is a detection."""
    produces = ports("detections", "tap", "amplitude")

    def step(self, block):
        frames = block.frames
        tap = np.tile(np.arange(frames.taps, dtype=float), len(frames))
        return block.replace(detections=Detections(
            np.repeat(frames.index, frames.taps), tap=tap, amplitude=frames.amplitude.ravel()))


class AtLeastParams(Params):
    minimum: float = Field(0.0)


class AtLeast(Filter[AtLeastParams]):
    """Strong detections."""
    consumes = ports("detections", "amplitude")

    def keep(self, block):
        return block.detections["amplitude"] >= self.params.minimum


class Meters(Stage[Params]):
    """Range by tap and by where the robot stands."""
    consumes = ports("detections", "tap")
    produces = ports("range_m")
    rowwise = True

    def step(self, block):
        found = block.detections
        return block.with_columns(range_m=found["tap"] + block.frames.position_m[block.rows, 0])


class LateParams(Params):
    frames: int = 2


class Late(Stage[LateParams]):
    """Holds every frame back for a while."""
    consumes = ports("detections")

    def open(self, radar):
        super().open(radar)
        self.held = None

    def step(self, block):
        whole = block if self.held is None else Block.join([self.held, block])
        ready = max(0, len(whole.frames) - self.params.frames)
        self.held = self.cut(whole, ready, len(whole.frames))
        return self.cut(whole, 0, ready)

    def flush(self):
        held, self.held = self.held, None
        return held

    @staticmethod
    def cut(block, start, stop):
        rows = (block.rows >= start) & (block.rows < stop)
        return Block(block.frames.part(start, stop), detections=block.detections.take(rows))


class Phase(Stage[Params]):
    """Needs STS."""
    consumes = ports("detections")
    produces = ports("pdoa_rad")
    needs = ports("sts")

    def step(self, block):
        return block.with_columns(pdoa_rad=np.zeros(len(block.detections)))


class AfterPhase(Stage[Params]):
    """Consumes what Phase produces."""
    consumes = ports("pdoa_rad")

    def step(self, block):
        self.note("phase was used")
        return block


class Known(Stage[Params]):
    """Yields the true range."""
    needs = ports("truth")
    produces = ports("detections", "range_m")

    def show_truth(self, truth, trajectory):
        self.range_m = truth.seen_from(self.radar, trajectory).range_m[:, 0]

    def step(self, block):
        index = block.frames.index
        return block.replace(detections=Detections(index, range_m=self.range_m[index]))


class Mute(Stage[Params]):
    """Frames are gone behind it."""
    removes = ports("frames")

    def step(self, block):
        return block


class NeedsFrames(Stage[Params]):
    """Wants frames."""
    consumes = ports("frames")

    def step(self, block):
        return block
'''
NAMES = {
    "every": "Every",
    "at_least": "AtLeast",
    "meters": "Meters",
    "late": "Late",
    "phase": "Phase",
    "after_phase": "AfterPhase",
    "known": "Known",
    "mute": "Mute",
    "needs_frames": "NeedsFrames",
}


@pytest.fixture(autouse=True)
def stages(install_plugin):
    points = {f"t.{name}": f"teststages:{target}" for name, target in NAMES.items()}
    install_plugin("teststages", {"stages": points}, {"teststages.py": STAGES})


def detector(*steps):
    """Detector of steps such as ``late``, or ``(name, params)``."""
    lines = ["schema: 1", "name: mine", "pipeline:"]
    for number, step in enumerate(steps):
        name, params = (step, "{}") if isinstance(step, str) else step
        optional = name.endswith("?")
        name = name.rstrip("?")
        lines.append(f"  - {{use: t.{name}, as: {name}-{number}, params: {params}, optional: {str(optional).lower()}}}")
    return detector_from_yaml("\n".join(lines))


def capture_of(frames=10, taps=4, invalid=()) -> Capture:
    rng = np.random.default_rng(3)
    preamble = (rng.normal(size=(frames, taps)) + 1j * rng.normal(size=(frames, taps))).astype(np.complex64)
    preamble[list(invalid), 1] = np.nan
    position_m = np.stack([np.arange(frames) * 100.0, np.zeros(frames), np.zeros(frames)], axis=1)
    return Capture(
        name="run",
        radar=Radar("test", 8e9, 5e8, 1e-9, 50.0, taps=taps),
        trajectory=Trajectory(np.arange(frames) / 50.0, position_m, np.zeros(frames)),
        preamble=preamble,
    )


def rows_of(found: Detections):
    columns = sorted(found.columns)
    rows = np.stack([found[name].astype(float) for name in columns], axis=1)
    return columns, rows[np.lexsort(rows.T[::-1])]


def assert_same(left: Detections, right: Detections):
    (names, rows), (other_names, other_rows) = rows_of(left), rows_of(right)
    assert names == other_names
    np.testing.assert_array_equal(rows, other_rows)
    np.testing.assert_array_equal(left.processed, right.processed)
    assert left.notes == right.notes


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


# The audit.

CHAIN = ("every", ("at_least", "{minimum: 0.5}"), "meters", ("at_least", "{minimum: 1.0}"))


@pytest.mark.parametrize("steps", [CHAIN, (*CHAIN[:2], "late", *CHAIN[2:]), (*CHAIN, "late")])
@pytest.mark.parametrize("invalid", [(), (0, 4)])
def test_retained_and_rejected_add_up_to_the_candidates(steps, invalid):
    capture = capture_of(invalid=invalid)
    found = detector(*steps).run(capture, candidates=True)
    candidates = found.candidates
    retained = candidates["retained"] == 1
    amplitude = np.abs(capture.preamble.astype(complex))[np.setdiff1d(np.arange(10), invalid)]
    assert len(candidates) == amplitude.size
    assert retained.sum() == len(found) == (amplitude >= 1.0).sum()
    np.testing.assert_array_equal(np.sort(candidates["amplitude"][retained]), np.sort(found["amplitude"]))


def test_the_chain_counts_what_is_left_behind_each_step():
    capture = capture_of()
    amplitude = np.abs(capture.preamble.astype(complex))
    some, few = int((amplitude >= 0.5).sum()), int((amplitude >= 1.0).sum())
    for steps in (CHAIN, (*CHAIN[:2], "late", *CHAIN[2:])):
        chain = list(detector(*steps).run(capture).chain.values())
        assert sorted(chain, reverse=True) == chain
        assert list(dict.fromkeys(chain)) == [40, some, few]


@pytest.mark.parametrize("place", [1, 2, 3])
def test_rejected_candidates_are_described_like_retained_ones(place):
    """Also where a stage holds frames back between the filter and the description."""
    steps = list(CHAIN)
    steps.insert(place, ("late", "{frames: 3}"))
    found = detector(*steps).run(capture_of(), candidates=True).candidates
    described = ~np.isnan(found["range_m"])
    np.testing.assert_array_equal(found["range_m"][described], (found["tap"] + 100.0 * found.frame)[described])
    assert described[found["retained"] == 1].all()
    assert described.all()


def test_candidates_are_the_same_whether_asked_for_before_or_after():
    pipeline, capture = detector(*CHAIN), capture_of()
    assert_same(pipeline.run(capture).candidates, pipeline.run(capture, candidates=True).candidates)


@pytest.mark.parametrize("steps", [CHAIN, (*CHAIN[:2], ("late", "{frames: 3}"), *CHAIN[2:])])
def test_the_audit_names_the_filter_that_dropped_each_candidate(steps):
    found = detector(*steps).run(capture_of(invalid=[2]), candidates=True)
    candidates, labels = found.candidates, list(found.chain)
    amplitude, by = candidates["amplitude"], candidates["rejected_by"]
    np.testing.assert_array_equal(by == labels.index("at_least-1"), amplitude < 0.5)
    np.testing.assert_array_equal(
        by == labels.index(f"at_least-{len(steps) - 1}"), (amplitude >= 0.5) & (amplitude < 1)
    )
    np.testing.assert_array_equal(np.isnan(by), candidates["retained"] == 1)


def test_signals_are_the_blocks_that_the_first_detecting_stage_is_handed(approach):
    blocks = list(load_detector("background-mean").signals(approach))
    assert sum(len(block.frames) for block in blocks) == len(approach)
    assert all(block.profile is not None and block.noise_rms is not None for block in blocks)
    assert not any(len(block.detections) for block in blocks)
    raw, cleaned = approach.frames(200, 201).amplitude[0], blocks[0].frames.amplitude[200]
    assert abs(np.argmax(raw) - 7) <= 1  # the direct path
    assert np.argmax(cleaned) > 12  # the plate


def test_the_audit_changes_no_result():
    pipeline, capture = detector(*CHAIN, "late"), capture_of()
    assert_same(pipeline.run(capture), pipeline.run(capture, candidates=True))


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
