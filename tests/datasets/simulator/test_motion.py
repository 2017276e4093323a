"""Objects that move: truth and echoes are where the object is in each frame."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from uwbbench_datasets.simulator.motion import Sway, Walk
from uwbbench_datasets.simulator.shapes import ObjectModel

PLACE = np.array([3.0, 0.3])
BODIES: dict[str, dict[str, Any]] = {
    "box": {"shape": "box", "yaw_deg": 170, "width_m": 0.4, "depth_m": 0.3, "height_m": 0.5},
    "plate": {"shape": "plate", "yaw_deg": 180, "width_m": 0.4, "height_m": 0.5},
    "rod": {"shape": "rod", "radius_m": 0.05, "height_m": 1.0},
    "point": {"shape": "point"},
    "faded": {"shape": "person", "fading": {"length_m": 0.2}, "tail": {"length_m": 0.3}, "bearing_sd_deg": 3.0},
}
ECHOES = ["direct", "echo.plate", "echo.cylinder", "echo.point", "ghost.robot", "occlusion"]


def walk(start, end, speed=0.5, **more):
    return {
        "kind": "waypoints",
        "points_m": [list(map(float, start)), list(map(float, end))],
        "speed_m_s": speed,
        **more,
    }


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_an_object_that_comes_is_seen_as_one_that_is_approached(run_scene, body) -> None:
    terms = [{"use": term} for term in ECHOES]
    come = {"id": "it", **body, "motion": walk(PLACE, PLACE - [1.0, 0.2])}
    coming = run_scene(terms, objects=[come])
    approach = {"kind": "waypoints", "points_m": [[0.0, 0.0], [1.0, 0.2]], "speed_m_s": 0.5, "yaw_deg": 0.0}
    stands = {"id": "it", **body, "center_m": PLACE.tolist()}
    approached = run_scene(terms, objects=[stands], trajectory={**approach})
    frames = min(len(coming), len(approached))
    sights = [one.truth.seen_from(one.radar, one.trajectory) for one in (coming, approached)]
    np.testing.assert_allclose(sights[0].range_m[:frames], sights[1].range_m[:frames], atol=1e-9)
    size = np.abs(approached.preamble).max()
    np.testing.assert_allclose(coming.preamble[:frames], approached.preamble[:frames], atol=2e-5 * size)


def test_an_object_that_moves_hides_others_while_it_stands_before_them(run_scene) -> None:
    screen = {"id": "screen", **BODIES["plate"], "motion": walk([1.5, -2.0], [1.5, 2.0], speed=2.0)}
    post = {"id": "post", "shape": "point", "center_m": [3.0, 0.0]}
    seen = run_scene([{"use": "direct"}, {"use": "echo.point"}, {"use": "occlusion"}], objects=[post, screen])
    occluded = seen.truth.seen_from(seen.radar, seen.trajectory).occluded[:, 0]
    bare = np.abs(seen.preamble - seen.preamble[48]).max(axis=1) < 1e-9  # frame 48: the screen is in the middle
    assert occluded[48]
    assert 4 < occluded.sum() < 20
    assert not np.any(occluded & ~bare)  # the transmitter's sight is cut in more frames than the receiver's


def test_blocks_of_a_long_run_see_the_object_where_it_is(run_scene) -> None:
    person = {"id": "p", "shape": "person", "motion": walk([1.5, 0.0], [3.5, 0.0], speed=0.05)}
    capture = run_scene(
        [{"use": "direct"}, {"use": "echo.cylinder"}],
        objects=[person],
        trajectory={"kind": "static", "duration_s": 40.0},
    )
    assert len(capture) > 1800
    range_m = capture.truth.seen_from(capture.radar, capture.trajectory).range_m[:, 0]
    early, late = (np.abs(capture.preamble[frame]) for frame in (200, 1700))
    tap_m = 299792458.0 * capture.radar.sample_interval_s / 2
    for response, range_ in ((early, range_m[200]), (late, range_m[1700])):
        assert abs(14 + np.argmax(response[14:]) - 7 - range_ / tap_m) < 1.5


def test_receivers_see_one_motion_and_runs_several(tmp_path) -> None:
    import yaml

    from uwbbench_datasets.simulator.engine import simulate
    from uwbbench_datasets.simulator.scene import read_scenes

    data = {
        "schema": 1,
        "receivers": {"front": {}, "left": {"mount_yaw_deg": 90}},
        "trajectory": {"kind": "static", "duration_s": 0.5},
        "objects": [{"id": "p", "shape": "person", "center_m": [2, 0], "motion": {"kind": "sway"}}],
        "terms": [{"use": "direct"}],
    }
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(data))
    (scene,) = read_scenes(tmp_path / "scene.yaml")
    first, second = (simulate(scene, run).captures for run in (1, 2))
    outlines = [one.truth.objects[0].outline_m for one in (*first, second[0])]
    np.testing.assert_array_equal(outlines[0], outlines[1])
    assert not np.array_equal(outlines[0], outlines[2])


def test_a_walk_waits_goes_and_stands() -> None:
    motion = Walk.model_validate({"kind": "waypoints", "points_m": [[0, 0], [1, 0], [1, 1]], "start_s": 1.0})
    places = motion.places_m(np.array([0.0, 1.0, 1.5, 2.5, 9.0]))
    assert places[:, :2].tolist() == [[0, 0], [0, 0], [0.5, 0], [1, 0.5], [1, 1]]


def test_breathing_is_along_the_heading_at_its_rate_and_amplitude() -> None:
    time_s = np.arange(0, 40, 0.01)
    offset = Sway(drift_m=0.0, amplitude_m=0.01, rate_hz=0.25).offset_m(time_s, np.pi / 2, np.random.default_rng(0))
    assert np.abs(offset[:, [0, 2]]).max() < 1e-12
    assert np.ptp(offset[:, 1]) == pytest.approx(0.02, rel=1e-3)
    spectrum = np.abs(np.fft.rfft(offset[:, 1]))
    assert np.fft.rfftfreq(len(time_s), 0.01)[spectrum.argmax()] == pytest.approx(0.25)


def test_drift_has_the_stated_spread_and_correlation() -> None:
    sway, time_s = Sway(amplitude_m=0.0, drift_m=0.02, drift_s=5.0), np.array([0.0, 5.0])
    rng = np.random.default_rng(11)
    drifts = np.stack([sway.offset_m(time_s, 0.0, rng)[:, :2] for _ in range(1500)])
    assert drifts.std(axis=0) == pytest.approx(np.full((2, 2), 0.02), rel=0.1)
    for axis in (0, 1):
        assert np.corrcoef(drifts[:, :, axis].T)[0, 1] == pytest.approx(np.exp(-0.5), abs=0.1)


PERSON = {"id": "p", "shape": "person"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"center_m": [1, 0], "motion": {"kind": "sway", "amplitude_m": 0, "drift_m": 0}},
            "sways by nothing never moves",
        ),
        (
            {"motion": walk([1, 0], [1, 0])},
            "all points_m are one: a body that never moves has a center_m and no motion",
        ),
        ({"center_m": [1, 0], "motion": walk([1, 0], [2, 0])}, "both say where it is; leave center_m out"),
        ({}, "a person needs center_m"),
        ({"motion": {"kind": "sway"}}, "a person needs center_m"),
        ({"shape": "wall", "width_m": 2, "center_m": [1, 0], "motion": {"kind": "sway"}}, "a wall does not move"),
        ({"motion": {"kind": "walk"}}, "'sway', 'waypoints'"),
    ],
)
def test_motion_that_cannot_be_is_refused(given, message) -> None:
    with pytest.raises(ValidationError, match=message):
        ObjectModel.model_validate({**PERSON, **given})
