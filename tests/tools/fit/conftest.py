"""Small fits of one plate that a robot stands before."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from uwbbench.tools.fit import Fit, read_fit

SCENE = """\
schema: 1
description: a plate
radar: {channel: 9, taps: 40}
trajectory: {kind: static, position_m: [0.0, 0.0], duration_s: 0.4}
objects:
  - {id: plate, shape: plate, center_m: [2.0, 0.0], yaw_deg: 180, width_m: 0.5, height_m: 0.5}
terms: [{use: direct}, {use: echo.plate}, {use: noise, params: {snr_db: 40}}]
"""
FIT: dict[str, Any] = {
    "schema": 1,
    "source": "figures of a test",
    "detector": "constant",
    "gate_m": 0.5,
    "cells": {"near": {"scene": "plate.yaml"}},
    "parameters": {"distance": {"in": "plate.yaml", "path": "objects.plate.center_m.0", "low": 1.0, "high": 2.0}},
    "targets": {"near": {"filtering": {"mae": 0.3}}},
    "tolerances": {"mae": {"absolute": 0.15}},
    "fitting": {"seeds": [1]},
    "checking": {"seeds": [2, 3]},
    "search": {"stages": [{"trials": 12}]},
}


@pytest.fixture
def plan(tmp_path: Path) -> Callable[..., Fit]:
    """Write a fit file with some keys changed, and read it."""
    (tmp_path / "plate.yaml").write_text(SCENE)

    def made(**changes: object) -> Fit:
        path = tmp_path / "own.yaml"
        path.write_text(yaml.safe_dump({**FIT, **changes}, sort_keys=False))
        return read_fit(path)

    return made
