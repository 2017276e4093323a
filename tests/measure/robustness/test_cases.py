"""The hard cases: shipped and rarer detectors stand them, and detectors with a fault do not."""

import re

import pytest

from tests.fixtures.shipped import OF_CAPTURES, WITH_RANGES
from uwbbench import load_detector
from uwbbench.api import PluginError
from uwbbench.measure.robustness import all_cases, case_named, examine
from uwbbench.measure.robustness.subject import Subject

PATH = "{use: first_path.crest}"
NOISE = "{use: noise_floor}"
PEAKS = "{use: peaks}"
SNR = "{use: score.snr}"
RANGE = "{use: range}"


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_CAPTURES)
def test_a_shipped_detector_stands_every_case(name):
    found = examine(load_detector(name))
    assert [(one.check.name, one.found) for one in found.results if one.status == "failed"] == []
    assert (found.largest_error_m or 0.0) <= 1e-9
    # The letter of the paper, arctan(Q/I), cannot tell opposite phases apart, and loses echoes by the filter on phase.
    # An answer for a whole window is none for a robot that moves, and one about presence has no range.
    elsewhere = name.endswith(("-bma", "-bsda")) or name not in WITH_RANGES
    assert found.usual_hits >= {"null": 0.0, "constant": 0.0, "paper-as-printed": 0.7}.get(name, 0.85 * (not elsewhere))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["greatest of", "smallest of", "all frames so far", "running median", "adaptive average"]
)
def test_a_detector_of_rarer_stages_stands_every_case(rare_detectors, name):
    found = examine(rare_detectors[name])
    assert [(one.check.name, one.found) for one in found.results if one.status == "failed"] == []


@pytest.fixture(scope="module")
def subjects():
    """Shipped detectors of all kinds."""
    names = ["paper", "paper-subsample", "cfar-ca", "background-svd", "background-mean", "background-ema", "entropy"]
    return [Subject(load_detector(name)) for name in [*names, "coupling-logistic"]]


@pytest.mark.parametrize("case", all_cases(), ids=lambda case: case.name)
def test_every_case_applies_to_some_shipped_detector(subjects, case):
    assert any(case.judge(one).status == "passed" for one in subjects)


def test_cases_have_names_of_their_own_and_say_what_they_expect():
    cases = all_cases()
    assert len({case.name for case in cases}) == len(cases) >= 60
    assert all(case.statement.endswith(".") and case.expectation for case in cases)


# Faults that the cases are there to find


@pytest.mark.parametrize(
    ("case", "says", "steps"),
    [
        ("direct-path-120-db-above-the-floor", "detections behind tap", ["{use: cfar.running_sums}"]),
        (
            "values-on-a-filter-limit",
            r"\[True, False, True\]",
            [PATH, NOISE, "{use: profile.minmax}", PEAKS, SNR, "{use: filter.snr.passes_nan}", RANGE],
        ),
        (
            "score-against-no-noise",
            "1 of 3 detections kept, with scores .nan.|2 of 3 detections kept, with scores",
            [
                PATH,
                NOISE,
                "{use: profile.minmax}",
                PEAKS,
                "{use: score.snr.infinite}",
                "{use: filter.snr, params: {minimum_db: 9}}",
            ],
        ),
        (
            "zero-noise-taps",
            "infinite score_db",
            [PATH, NOISE, "{use: profile.minmax}", PEAKS, "{use: score.snr.infinite}", RANGE],
        ),
        (
            "full-phase-in-the-arcsine",
            "nan",
            [PATH, "{use: profile.minmax}", PEAKS, "{use: pdoa}", "{use: azimuth.unclipped}", RANGE],
        ),
        (
            "phase-difference-of-pi",
            "expected -pi throughout",
            [PATH, "{use: profile.minmax}", PEAKS, "{use: pdoa.product}", RANGE],
        ),
        ("zero-frames", "RuntimeWarning", [PATH, "{use: profile.naive}", PEAKS, RANGE]),
        ("rippled-constant-frames", "detections of rounding errors", [PATH, "{use: profile.naive}", PEAKS, RANGE]),
        ("ill-conditioned-window", "units of the clutter off", ["{use: clutter.svd.gram}", "{use: cfar.ca}"]),
        (
            "map-coordinates",
            "points",
            [
                PATH,
                "{use: profile.minmax}",
                PEAKS,
                "{use: pdoa}",
                "{use: azimuth}",
                RANGE,
                "{use: position}",
                "{use: dbscan.plane}",
            ],
        ),
        ("zero-frames", "hold no echo", ["{use: echo.of_nan}"]),
        ("constant-capture", "where nothing is", ["{use: echo.of_nan}"]),
        ("frames-unlike-any-of-training", "'probability' of nan", [PATH, "{use: classify.plain}"]),
        ("frames-without-a-direct-path-to-count-from", "3 rows", [PATH, "{use: classify.plain}"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_fault_is_found(faulty, make_detector, judged, case, says, steps):
    outcome = judged(case, make_detector(*steps))
    assert outcome.status == "failed"
    assert re.search(says, outcome.found), outcome.found


def test_a_stage_that_raises_fails_the_case_and_no_other(install_plugin, make_detector):
    source = """
from uwbbench.api import Params, Stage, ports

class Fragile(Stage[Params]):
    consumes = ports("frames")
    produces = ports("detections")

    def step(self, block):
        if len(block.frames) == 1:
            raise ValueError("one frame is not enough")
        return block
"""
    install_plugin("fragile", {"stages": {"fragile": "uwbbench_fragile:Fragile"}}, {"uwbbench_fragile.py": source})
    cases = [case_named("one-frame-capture"), case_named("zero-capture")]
    one, other = examine(make_detector("{use: fragile}"), cases).results
    assert (one.status, one.found) == ("failed", "ValueError: one frame is not enough")
    assert other.status == "passed"


BROUGHT = '''
from uwbbench.api import Evidence, Violation, hard_case


@hard_case("survive")
def {name}(subject):
    """The first path is found in one frame."""
    block = subject.through(subject.stage("first_path"), subject.block_of([[0, 0, 0, 0, 0, 1, 0, 0, 0] * 5]))
    if block.first_path[0] != 5:
        raise Violation("elsewhere")
    return Evidence("there")


CASES = ({name},)
'''


def test_a_package_brings_hard_cases_of_its_stages(install_plugin, make_detector):
    install_plugin(
        "brought", {"cases": {"brought": "brought_cases:CASES"}}, {"brought_cases.py": BROUGHT.format(name="one_crest")}
    )
    case = case_named("one-crest")
    assert case in all_cases()
    assert (case.group, case.asked) == ("brought_cases", "survive: The first path is found in one frame.")
    with_path, without = make_detector(PATH, "{use: cfar.ca}", RANGE), make_detector("{use: reference.nothing}")
    assert [one.status for one in examine(with_path, [case]).results] == ["passed"]
    assert [one.detail for one in examine(without, [case]).results] == ["the detector has no stage 'first_path'"]


def test_two_hard_cases_of_one_name_are_refused(install_plugin):
    install_plugin(
        "brought", {"cases": {"brought": "brought_cases:CASES"}}, {"brought_cases.py": BROUGHT.format(name="plateaus")}
    )
    with pytest.raises(PluginError, match="two hard cases are named 'plateaus'"):
        all_cases()
