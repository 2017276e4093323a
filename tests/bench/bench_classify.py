"""Classifying frames by trees and by networks, one a call as in a stream; trees against scikit-learn with the same.

Run through ``python tests/bench/run.py classify``. The trees are grown as those of ``coupling-extra-trees``, on labels
that mean nothing: what a walk costs hangs on their depth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import frames as made
import numpy as np
from harness import Disagreement, Effort, Row, Run, at_least, at_most, interleaved, median, ratio

from uwbbench.api import Block, load_plugin
from uwbbench.api.arrays import locked
from uwbbench.detect.pipeline import load_detector
from uwbbench_detectors.classify.features import features_of

FRAMES, CLASSES = 2000, 3


def rows(effort: Effort) -> list[Row]:
    """All targets of this module."""
    detector = load_detector("coupling-extra-trees")
    step = detector.config.steps[2]
    capture = made.approach(effort.frames(FRAMES), sts=False)
    block = Block.join(list(detector.arriving(capture, step.label)))
    stage: Any = load_plugin("stages", step.use)(load_plugin("stages", step.use).params_type()(**step.params))
    features, there = features_of(block)
    features = features[there]
    label = np.random.default_rng(1).integers(0, CLASSES, len(features))
    grown = stage.grown(features, label, 1)
    stage.load({name: locked(values) for name, values in stage.learn(features, label, 1).items()})
    stage.open(capture.radar)
    if np.abs(stage.probabilities(features) - grown.predict_proba(features)).max() > 1e-6:
        raise Disagreement("trees: other probabilities than scikit-learn's")
    few = range(20)
    alone = [
        block.replace(frames=block.frames.part(k, k + 1), first_path=block.part("first_path")[k : k + 1]) for k in few
    ]

    def each(call: Callable[[int], Any]) -> Callable[[], Run]:
        return lambda: lambda: [call(k) for k in few]

    seconds = interleaved(
        {
            "stage": each(lambda k: stage.step(alone[k])),
            "scikit-learn": each(lambda k: grown.predict_proba(features[k : k + 1])),
        },
        effort.rounds(9),
    )
    return [
        at_most(
            "trees over one frame in a stream, features included", 0.3, median(seconds["stage"] / len(few) * 1e3), "ms"
        ),
        at_least(
            "... against scikit-learn, features not included", 100, ratio(seconds["scikit-learn"], seconds["stage"])
        ),
        *networks(effort),
    ]


def networks(effort: Effort) -> list[Row]:
    """One frame a call through the recurrent networks as they are shipped, one way along the taps and both ways."""
    calls = {name: _network(name, effort.frames(200)) for name in ("dwt-lstm", "dwt-bilstm")}
    seconds = interleaved({name: call for name, (call, _) in calls.items()}, effort.rounds(9))
    return [
        at_most(f"{name}: network over one frame in a stream", 1.0, median(seconds[name] / calls[name][1] * 1e3), "ms")
        for name in calls
    ]


def _network(name: str, count: int) -> tuple[Callable[[], Run], int]:
    """Steps over single frames, and how many they are."""
    detector = load_detector(name)
    step = next(one for one in detector.config.steps if one.use == "classify.lstm")
    capture = made.approach(count, sts=False)
    block = Block.join(list(detector.arriving(capture, step.label)))
    network = load_plugin("stages", step.use)
    stage: Any = next(one for one in detector.open(capture).stages if isinstance(one, network))  # with its weights
    alone = [block.cut(place, place + 1) for place in range(count)]
    return lambda: lambda: [stage.step(one) for one in alone], count
