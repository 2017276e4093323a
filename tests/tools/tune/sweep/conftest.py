"""Short simulated captures, on which a detector can run for every set of a grid."""

from functools import cache

import pytest

from uwbbench.api.registry import load_plugin


@pytest.fixture(scope="session")
def short():
    """A simulated approach of about 75 frames to a box of concrete: ``short(channel, sts)``."""

    @cache
    def short(channel=9, sts=True, **params):
        adapter = load_plugin("datasets", "approach")
        params = {"material": "concrete", "frame_rate_hz": 8.0, "channel": channel, "sts": sts, **params}
        dataset = adapter(adapter.params_type().model_validate(params), ())
        return dataset.open(dataset.names()[0])

    return short
