"""Scenes made up in a test: a view of objects, single terms, and whole simulations."""

from typing import Any

import numpy as np
import pytest
import yaml

from uwbbench.api import Capture, Radar, Term, View
from uwbbench.api.geometry import receiver_pose
from uwbbench.api.registry import load_plugin
from uwbbench_datasets.simulator.engine import simulate
from uwbbench_datasets.simulator.pulses import GaussianPulse
from uwbbench_datasets.simulator.scene import read_scenes
from uwbbench_datasets.simulator.shapes import ObjectModel


def build_view(position_m: Any, objects: Any = (), *, yaw_rad: Any = 0.0, tx: Any = (0.0, -0.25, 0.0)) -> View:
    """View of scene objects (as YAML would name them) from robot positions (frames, 2 or 3)."""
    position = np.atleast_2d(np.asarray(position_m, float))
    position = np.pad(position, ((0, 0), (0, 3 - position.shape[1])))
    frames = len(position)
    yaw = np.broadcast_to(np.asarray(yaw_rad, float), (frames,))
    radar = Radar(
        model="test",
        center_frequency_hz=7987.2e6,
        bandwidth_hz=499.2e6,
        sample_interval_s=1e-9,
        frame_rate_hz=48.0,
        taps=50,
        tx_position_m=tx,
        array_spacing_m=17.8e-3,
        has_sts=True,
    )
    bodies = tuple(ObjectModel.model_validate(one).body() for one in objects)
    receiver, boresight = receiver_pose(position, yaw, np.zeros(3), 0.0)
    transmitter, _ = receiver_pose(position, yaw, np.asarray(tx, float), 0.0)
    slope = 2 * np.pi * 17.8e-3 / radar.wavelength_m
    return View(
        radar=radar,
        first=0,
        timestamp_s=np.arange(frames) / 48.0,
        receiver_m=receiver,
        transmitter_m=transmitter,
        boresight_rad=boresight,
        objects=bodies,
        visibility=np.ones((frames, len(bodies))),
        crest_tap=np.full(frames, 7.0),
        direct_amplitude=1.0,
        receive_gain=lambda azimuth_rad: np.ones(np.shape(azimuth_rad)),
        array_phase=lambda azimuth_rad: slope * np.sin(azimuth_rad),
        pulse=GaussianPulse(3.2e-9),
    )


@pytest.fixture(scope="session")
def make_view():
    """Build a view."""
    return build_view


@pytest.fixture(scope="session")
def make_term():
    """Build a registered term with parameters."""

    def build(name: str, **params: Any) -> Term[Any]:
        kind = load_plugin("terms", name)
        return kind(kind.params_type().model_validate(params))

    return build


@pytest.fixture
def run_scene(tmp_path):
    """Simulate one run of a scene of these terms; two seconds standing still, unless told otherwise."""

    def run(terms: list[Any], **scene: Any) -> Capture:
        usual = {"schema": 1, "trajectory": {"kind": "static", "duration_s": 2.0}, "fidelity": {"mode": "all"}}
        path = tmp_path / "scene.yaml"
        path.write_text(yaml.safe_dump({**usual, **scene, "terms": terms}))
        return simulate(read_scenes(path)[0]).captures[0]

    return run


@pytest.fixture
def rng():
    """Seeded random numbers."""
    return np.random.default_rng(7)
