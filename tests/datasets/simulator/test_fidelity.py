"""Leaving terms out: only those that noise covers, and without changing what detectors find."""

from pathlib import Path

import numpy as np
import pytest

from uwbbench.detect.pipeline import load_detector
from uwbbench_datasets.simulator.engine import BLOCK, simulate
from uwbbench_datasets.simulator.scene import Scene, read_scenes

SCENE = """\
schema: 1
trajectory: {kind: straight, start_m: [0, 0], end_m: [2.0, 0], speed_m_s: 0.3}
objects:
  - {id: plate, shape: plate, center_m: [3.0, 0.0], width_m: 0.25, height_m: 0.28}
  - {id: crumb, shape: point, center_m: [2.8, 0.6], material: wood}
terms:
  - {use: direct}
  - {use: ringing}
  - {use: echo.plate}
  - {use: echo.point, params: {rcs_m2: 1.0e-7}}
  - {use: grid}
  - {use: frame_gain}
  - {use: noise}
"""


@pytest.fixture
def scene(tmp_path: Path):
    def made(**changes: object) -> Scene:
        path = tmp_path / "scene.yaml"
        path.write_text(SCENE)
        return read_scenes(path, changes)[0]

    return made


def reasons(scene: Scene) -> dict[str, str]:
    return {one.name: one.reason for one in simulate(scene).contributions["front"]}


def test_a_term_far_below_the_noise_is_left_out_and_the_capture_says_so(scene) -> None:
    simulation = simulate(scene())
    crumb = next(one for one in simulation.contributions["front"] if one.name == "echo.point")
    assert not crumb.kept
    assert crumb.level_db < -10
    assert crumb.pulses == 0
    assert "left out: echo.point" in simulation.captures[0].description
    assert {one.name for one in simulation.contributions["front"] if not one.kept} == {"echo.point"}


@pytest.mark.parametrize("changes", [{"fidelity.mode": "all"}, {"fidelity.force": ["echo.point"]}])
def test_a_term_can_be_forced_back_in(scene, changes) -> None:
    assert reasons(scene(**changes))["echo.point"] == "forced"


def test_the_margin_decides(scene) -> None:
    (level,) = (one.level_db for one in simulate(scene()).contributions["front"] if one.name == "echo.point")
    assert reasons(scene(**{"fidelity.margin_db": -level + 0.1}))["echo.point"] == "above the margin"
    assert reasons(scene(**{"fidelity.margin_db": -level - 0.1}))["echo.point"] == "below the margin"


def test_without_noise_nothing_is_left_out(scene) -> None:
    assert "below the margin" not in reasons(scene(**{"terms.noise.params.snr_db": 400.0})).values()


@pytest.mark.parametrize("name", ["paper", "cfar-os"])
def test_what_is_left_out_changes_no_detection(scene, name: str) -> None:
    lean, full = (simulate(scene(**{"fidelity.mode": mode})).captures[0] for mode in ("auto", "all"))
    assert not np.array_equal(lean.preamble, full.preamble)
    found, expected = (load_detector(name).run(capture) for capture in (lean, full))
    assert len(expected) > 50
    assert np.array_equal(found.frame, expected.frame)
    assert np.allclose(found["range_m"], expected["range_m"], atol=0.02)


@pytest.mark.parametrize("use", ["direct", "ringing", "echo.plate", "echo.point", "echo.cylinder"])
def test_no_term_exceeds_its_bound(scene, use: str) -> None:
    things = [
        {"id": "plate", "shape": "plate", "center_m": [3.0, 0.0], "yaw_deg": 7, "width_m": 0.25, "height_m": 0.28},
        {"id": "box", "shape": "box", "center_m": [2.6, 0.9], "width_m": 0.3, "depth_m": 0.2, "height_m": 0.3},
        {"id": "rod", "shape": "rod", "center_m": [2.5, -0.5], "radius_m": 0.05, "height_m": 1.0},
        {"id": "point", "shape": "point", "center_m": [2.3, -0.3]},
    ]
    terms = [{"use": "direct"}, *([{"use": use}] if use != "direct" else []), {"use": "noise"}]
    chosen = scene(objects=things, terms=terms)
    level_db = next(one.level_db for one in simulate(chosen).contributions["front"] if one.name == use)
    noise = chosen.radar("front").wavelength_m / (4 * np.pi * 0.25) * 10 ** (-(6 + 45) / 20)
    alone = simulate(scene(objects=things, terms=[{"use": "direct"}, *terms[1:-1]])).captures[0]
    rest = simulate(scene(objects=things, terms=[{"use": "direct"}])).captures[0]
    added = alone.preamble if use == "direct" else alone.preamble - rest.preamble
    bound = noise * 10 ** (level_db / 20)
    assert np.abs(added).max() <= bound * (1 + 1e-5)
    assert np.abs(added).max() > bound / 10  # and the bound is not idle


def test_a_dropped_term_is_never_asked_for_paths(scene, monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = scene()
    term = next(cls for use, cls, _ in chosen.terms if use.name == "echo.point")
    asked: list[int] = []
    monkeypatch.setattr(term, "paths", lambda _self, view, _rng: asked.append(len(view)))
    simulate(chosen)
    assert asked == []
    simulate(scene(**{"fidelity.mode": "all"}))
    assert sum(asked) == 321
    assert max(asked) <= BLOCK
