"""Small tuning files on short simulated approaches."""

from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from tests.fixtures import chance
from uwbbench.tools.tune import Tuning, read_tuning

PROMINENCE = "pipeline.filter.prominence.params.minimum"
WIDTH = "pipeline.filter.width.params.minimum"
SCORE = "pipeline.filter.snr.params.minimum_db"


def _approach(material: str, seed: int, **params: object) -> dict[str, object]:
    """One short approach; other seeds are other recordings."""
    given = {"material": material, "seed": chance.seed(seed), "frame_rate_hz": 8.0, "sts": False, **params}
    return {"use": "approach", "name": f"{material}, seed {seed}, {params}", "params": given}


@pytest.fixture
def approach_of() -> Callable[..., dict[str, object]]:
    """Dataset of one short approach: ``approach_of("metal", seed, channel=5)``."""
    return _approach


@pytest.fixture
def contents() -> dict[str, object]:
    """A tuning of three thresholds on two captures, with another two held out."""
    return {
        "schema": 1,
        "detector": "paper-filtering",
        "grid": {
            PROMINENCE: [0.01, 0.03, 0.1],
            WIDTH: {"start": 0.5, "stop": 2.5, "count": 3},
            SCORE: [5, 15, 30],
        },
        "tuning": [_approach("concrete", 1), _approach("plywood", 1, channel=5)],
        "held_out": [_approach("concrete", 2), _approach("plywood", 2, channel=5)],
        "groups": ["overall"],
        "intervals": {"resamples": 100},
    }


@pytest.fixture
def tuning(tmp_path: Path, contents: dict[str, object]) -> Callable[..., Tuning]:
    """Write a tuning file with some keys changed, and read it."""

    def made(*, scored_by: str | None = None, **changes: object) -> Tuning:
        path = tmp_path / "own.yaml"
        values = {key: value for key, value in {**contents, **changes}.items() if value is not ...}
        path.write_text(yaml.safe_dump(values, sort_keys=False))
        return read_tuning(path, experiment=scored_by)

    return made
