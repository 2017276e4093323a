"""The compiled search finds what the plain stages find."""

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from uwbbench.api import Capture, Radar, Trajectory
from uwbbench.detect.pipeline import Pipeline, detector_from_yaml, load_detector
from uwbbench.measure.robustness.suite import examine
from uwbbench_detectors.compiled.chain import chain_of

from .agreement import assert_same

TAPS = 24
LENGTHS = (TAPS, 26, 50, 63, 64, 65, 80)
"""Around the most taps that are searched as bits of one word, and lengths that are no whole blocks."""
SHIPPED = (
    "paper",
    "paper-filtering",
    "paper-subsample",
    "paper-as-printed",
    "paper-metal",
    "paper-near",
    "background-mean",
    "background-svd",
    "cfar-os",
)


def captured(samples, sts=None, paths=None, **facts) -> Capture:
    """Capture of these responses (frames, taps)."""
    frames = len(samples)
    given_facts = {
        "model": "made up",
        "center_frequency_hz": 8e9,
        "bandwidth_hz": 5e8,
        "sample_interval_s": 1.0016e-9,
        "frame_rate_hz": 96.0,
        "taps": samples.shape[1],
        "channel": 9,
        "noise_taps": 4,
        "mount_position_m": (0.1, 0.05, 0.0),
        "mount_yaw_rad": 0.3,
        "tx_position_m": (0.1, -0.2, 0.1),
        "has_sts": sts is not None,
        "has_first_path": paths is not None,
    }
    generator = np.random.default_rng(1)
    return Capture(
        name="made up",
        radar=Radar(**{**given_facts, **facts}),
        trajectory=Trajectory(
            np.arange(frames) / 96.0, generator.normal(size=(frames, 3)), generator.uniform(-4, 4, frames)
        ),
        preamble=samples,
        sts1=None if sts is None else sts[0],
        sts2=None if sts is None else sts[1],
        first_path_index=None if paths is None else paths[0],
        first_path_index_sts1=None if paths is None else paths[1],
        first_path_index_sts2=None if paths is None else paths[2],
    )


def responses(seed: int, kind: str, frames: int = 12, dtype=np.complex64, taps: int = TAPS):
    """Frames (frames, taps) in which decisions are hard: ties, flat tops, ripples, zeros, huge spans, gaps."""
    rng = np.random.default_rng(seed)
    shape = (frames, taps)
    if kind == "integers":
        samples = rng.integers(-3, 4, shape) + 1j * rng.integers(-3, 4, shape)
    elif kind == "spans":
        samples = 10.0 ** rng.uniform(-18, 18, shape) * np.exp(2j * np.pi * rng.random(shape))
    elif kind == "ripple":
        samples = 1.0 + rng.integers(0, 3, shape) * 2.0**-23 + 0j
    elif kind == "comb":
        samples = np.where(np.arange(taps) % 2, 1.0, 0.1) * (1 + 0.01 * rng.random(shape)) + 0j
    elif kind == "faulty":
        samples = rng.normal(size=shape) + 1j * rng.normal(size=shape)
        samples[rng.random(shape) < 0.01] = np.nan
        samples[rng.random(frames) < 0.2] = 0
        samples[:, :4][rng.random(frames) < 0.3] = 0
    else:
        samples = rng.normal(size=shape) + 1j * rng.normal(size=shape)
        samples[:, 6] += 20
        samples[np.arange(frames), rng.integers(9, taps - 1, frames)] += 5
    return samples.astype(dtype)


@st.composite
def chains(draw) -> str:
    """A detector of stages that the search knows, in any of the arrangements it takes."""
    minmax = [
        "profile.minmax" + params for params in ("", ", params: {scope: frame_all_taps}", ", params: {skip_taps: 0}")
    ]
    profile = draw(st.sampled_from([*minmax, "profile.amplitude"]))
    noise = draw(
        st.sampled_from(
            [
                "",
                ", params: {method: median}",
                ", params: {method: tail, taps: 9}",
                ", params: {method: leading, taps: 17}",
            ]
        )
    )
    crest = draw(st.booleans())
    steps = [f"noise_floor{noise}", profile, f"first_path.crest, params: {{interpolate: {str(crest).lower()}}}"]
    steps.append(f"peaks, params: {{relative_height: {draw(st.sampled_from([0.5, 0.3, 0.9]))}}}")
    filters = [
        f"filter.first_path, params: {{guard_taps: {draw(st.sampled_from([0, 1, 2.5]))}}}",
        f"filter.prominence, params: {{minimum: {draw(st.sampled_from([0, 0.05, 0.5, 2.0]))}}}",
        f"filter.width, params: {{minimum: {draw(st.sampled_from([0, 0.5, 1, 2]))}, maximum: 9}}",
    ]
    steps += [one for one in filters if draw(st.booleans())]
    if draw(st.booleans()):
        steps.append(f"score.snr, params: {{gain_db_per_ns: {draw(st.sampled_from([0.0, 0.2, -0.1]))}}}")
        steps += [f"filter.snr, params: {{minimum_db: {draw(st.sampled_from([-5.0, 6.0, 12.0]))}}}"] * draw(
            st.booleans()
        )
    if draw(st.booleans()):
        sample = draw(st.sampled_from(["aligned", "same_tap"]))
        wrap = draw(st.sampled_from(["half_open", "closed_above"]))
        steps.append(f"pdoa, params: {{sample: {sample}, wrap: {wrap}}}")
        steps += ["filter.pdoa, params: {maximum_rad: 1.5}"] * draw(st.booleans())
    select = ["", "select.all", "select.strongest", "select.strongest, params: {count: 3}"]
    select += ["select.nearest", "select.nearest, params: {count: 2}"]
    steps += [one for one in [draw(st.sampled_from(select))] if one]
    steps += [f"interpolate, params: {{method: {draw(st.sampled_from(['parabola', 'log_parabola']))}}}"] * draw(
        st.booleans()
    )
    if any(step.startswith("pdoa") for step in steps) and draw(st.booleans()):
        formula = draw(st.sampled_from(["paper", "paper_inside", "physical, spacing_m: 0.0187"]))
        domain = draw(st.sampled_from(["theta", "alpha"]))
        steps.append(f"azimuth, params: {{formula: {formula}, bias_deg: 2.0, bias_domain: {domain}, sign: -1}}")
    geometry, baseline = draw(st.sampled_from(["exact", "paper"])), draw(st.sampled_from(["true", "false"]))
    printed = draw(st.sampled_from(["", ", tap_ns: 1.0", ", tap_ns: 1.0, speed_of_light: rounded"]))
    steps.append(f"range, params: {{geometry: {geometry}, includes_baseline: {baseline}, bias_m: 0.1{printed}}}")
    if any(step.startswith("azimuth") for step in steps):
        steps += ["position"] * draw(st.booleans())
    lines = "".join(f"  - {{use: {step}}}\n" for step in steps)
    return f"schema: 1\nname: drawn\npipeline:\n{lines}"


KINDS = ("integers", "spans", "ripple", "comb", "faulty", "echoes")


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    text=chains(),
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 2**31),
    double=st.booleans(),
    aligned=st.booleans(),
    from_transmission=st.booleans(),
    taps=st.sampled_from(LENGTHS),
)
def test_any_chain_finds_the_same_fused_and_plain(text, kind, seed, double, aligned, from_transmission, taps):
    dtype = np.complex128 if double else np.complex64
    sts = [responses(seed + 1 + n, "integers" if kind == "integers" else "echoes", 12, dtype, taps) for n in range(2)]
    rng = np.random.default_rng(seed)
    paths = [rng.uniform(4, 8, 12).round(2) for _ in range(3)] if aligned else None
    capture = captured(
        responses(seed, kind, 12, dtype, taps), sts, paths, first_tap_delay_s=-6e-9 if from_transmission else None
    )
    detector = detector_from_yaml(text)
    assert detector.open(capture).fused
    assert_same(detector.run(capture), detector.run(capture, fused=False))


def test_phases_by_the_printed_arctan_are_left_to_the_plain_stages(approach):
    detector = load_detector("paper", changes={"pipeline.pdoa.params": {"phase": "arctan"}})
    found = detector.run(approach)
    assert_same(found, detector.run(approach, fused=False))
    assert len(found) != len(load_detector("paper").run(approach))


@pytest.mark.parametrize("column", ["prominence", "width_taps", "score_db", "pdoa_rad"])
def test_a_threshold_that_a_peak_meets_exactly_is_decided_alike(approach, column):
    base = "schema: 1\nname: all\npipeline:\n" + "".join(
        f"  - {{use: {step}}}\n"
        for step in ("noise_floor", "profile.minmax", "first_path.crest", "peaks", "score.snr", "pdoa")
    )
    values = np.unique(np.abs(detector_from_yaml(base).run(approach)[column]))
    filters = {
        "prominence": "filter.prominence, params: {minimum: %r}",
        "width_taps": "filter.width, params: {minimum: %r}",
        "score_db": "filter.snr, params: {minimum_db: %r}",
        "pdoa_rad": "filter.pdoa, params: {maximum_rad: %r}",
    }
    for value in values[:: len(values) // 12]:
        text = base + f"  - {{use: {filters[column] % float(value)}}}\n  - {{use: select.strongest}}\n"
        detector = detector_from_yaml(text)
        assert_same(detector.run(approach), detector.run(approach, fused=False))


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("sts", [True, False])
def test_shipped_detectors_find_the_same_fused_and_plain(name, sts, approach, approach_without_sts):
    capture = approach if sts else approach_without_sts
    detector = load_detector(name)
    fused, plain = detector.run(capture), detector.run(capture, fused=False)
    assert_same(fused, plain)
    assert fused.chain == plain.chain


class BothWays(Pipeline):
    """A detector that runs every capture fused and plain, and compares."""

    compared = 0

    def run(self, capture, **options):
        found = super().run(capture, **options)
        assert_same(found, super().run(capture, fused=False))
        self.compared += 1
        return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "paper-filtering", "paper-subsample", "background-mean"])
def test_all_hard_cases_find_the_same_fused_and_plain(name):
    detector = BothWays(load_detector(name).config)
    failed = [result.check.name for result in examine(detector).results if not result.passed]
    assert failed == []
    assert detector.compared >= 15


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_share_a_block_without_changing_it(threads):
    capture = captured(responses(5, "echoes", frames=6000))
    detector = load_detector("paper-filtering")
    one, shared = detector.run(capture), detector.run(capture, threads=threads)
    assert len(one) > 1000
    assert_same(shared, one)
    np.testing.assert_array_equal(shared["range_m"], one["range_m"])


def test_threads_leave_frames_that_rounding_could_decide_to_the_plain_stages():
    samples = responses(5, "echoes", frames=6000)
    samples[::7, :4] = 0  # no noise, no score
    capture = captured(samples)
    detector = load_detector("paper-filtering")
    assert_same(detector.run(capture, threads=2), detector.run(capture, fused=False))


@pytest.mark.parametrize("every", [1, 2, 5, 40])
def test_frames_without_noise_among_others_and_among_invalid_ones_are_found_alike(every):
    samples = responses(8, "echoes", frames=300)
    samples[::every, :4] = 0
    samples[3::11, 5] = np.nan
    capture = captured(samples)
    detector = load_detector("paper-filtering")
    assert_same(detector.run(capture), detector.run(capture, fused=False))


def test_samples_that_may_not_be_written_to_or_lie_apart_are_searched_alike():
    samples = responses(3, "echoes", frames=40)
    usual = load_detector("paper-filtering").run(captured(samples))
    fixed = samples.copy()
    fixed.flags.writeable = False
    apart = np.repeat(samples, 2, axis=1)[:, ::2]
    for other in (fixed, apart):
        stream = load_detector("paper-filtering").open(captured(samples))
        frames = dataclasses.replace(captured(samples).frames(), preamble=other)
        assert_same(stream.step(frames), usual)


@pytest.mark.parametrize(
    ("steps", "covered"),
    [
        (["noise_floor", "profile.minmax", "first_path.crest", "peaks", "filter.width", "range"], 6),
        (["profile.minmax", "peaks, params: {window_taps: 5}"], 0),
        (["profile.minmax", "first_path.crest"], 0),
        (["noise_floor, params: {method: running_median}", "profile.minmax", "peaks"], 0),
        (["profile.minmax", "peaks", "select.strongest", "filter.width, params: {minimum: 1}"], 3),
    ],
)
def test_the_search_covers_the_stages_that_it_knows_in_an_order_that_it_keeps(steps, covered):
    params = {"filter.width": "filter.width, params: {minimum: 1}"}
    lines = "".join(f"  - {{use: {params.get(step, step)}}}\n" for step in steps)
    detector = detector_from_yaml(f"schema: 1\nname: short\npipeline:\n{lines}  - {{use: reference.nothing}}\n")
    stages = detector.open(captured(responses(1, "echoes")), fused=False).stages
    assert chain_of(stages)[1] == covered


def test_a_later_stage_that_wants_the_noise_keeps_it(install_plugin):
    install_plugin(
        "late",
        {"stages": {"late": "late_stage:Late"}},
        {
            "late_stage.py": """
from uwbbench.api import Params, Stage, ports

class Late(Stage[Params]):
    consumes = ports("detections", "noise")
    produces = ports("floor")

    def step(self, block):
        return block.with_columns(floor=block.part("noise_rms")[block.rows])
"""
        },
    )
    capture = captured(responses(2, "echoes"))
    detector = detector_from_yaml(
        "schema: 1\nname: late\npipeline:\n"
        "  - {use: noise_floor}\n  - {use: profile.minmax}\n  - {use: peaks}\n  - {use: late}\n"
    )
    found = detector.run(capture)
    assert np.all(found["floor"] > 0)
    assert_same(found, detector.run(capture, fused=False))


def test_a_kernel_that_cannot_be_loaded_is_named_and_the_stages_do_the_work(install_plugin):
    capture = captured(responses(2, "echoes"))
    usual = load_detector("paper-filtering").run(capture)
    install_plugin("broken", {"kernels": {"broken": "no_such_module:Kernel"}}, {})
    found = load_detector("paper-filtering").run(capture)
    assert any("kernel 'broken' of broken 1.0 cannot be loaded" in note for note in found.notes)
    np.testing.assert_array_equal(found["range_m"], usual["range_m"])
