"""Captures that a detector was trained on must not be scored with it: a result on them says nothing about others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from uwbbench.api import registry
from uwbbench.api.capture import Capture
from uwbbench.api.drive import Drive
from uwbbench.api.errors import ConfigError
from uwbbench.api.interruption import by_plugin
from uwbbench.api.learning import LearnedParams
from uwbbench.api.recording import leak_key
from uwbbench.api.weights import LearnedFrom, read_weights
from uwbbench.config.detector import BY_CHANNEL, DetectorConfig, Step
from uwbbench.config.source import CaptureRef, RunRef


@dataclass
class Known:
    """Captures by what tells that another one is of the same recording.

    Attributes
    ----------
    names : dict of str to str
        Name for people, by hash of the content and by what recordings that leak into each other share.
    """

    names: dict[str, str] = field(default_factory=dict)

    def add(self, name: str, sha256: str, recording: str) -> None:
        """Add a capture.

        Parameters
        ----------
        name : str
            For people.
        sha256, recording : str
            Of the capture.
        """
        for key in (sha256, leak_key(recording)):
            self.names.setdefault(key, name)

    def same(self, capture: Capture) -> str | None:
        """Name of a known capture that shares content, recording or draws with another one; None if none does."""
        if not self.names:
            return None
        by_recording = self.names.get(leak_key(capture.recording))
        return self.names.get(capture.sha256) if by_recording is None else by_recording


def trained_on(detector: DetectorConfig) -> Known:
    """Captures that the weights of a detector were learned from or chosen by.

    Raises
    ------
    ConfigError
        If weights cannot be read.
    """
    known = Known()
    for step in (*detector.steps, *(step for steps in detector.fronts.values() for step in steps)):
        for one in _learned_from(step):
            known.add(f"{one.dataset}: {one.capture}", one.sha256, one.recording)
    return known


def _learned_from(step: Step) -> Iterable[LearnedFrom]:
    stage = registry.load_plugin("stages", step.use)
    if not issubclass(stage.params_type(), LearnedParams):
        return
    given = step.params.get("weights")
    for reference in given[BY_CHANNEL].values() if isinstance(given, Mapping) else [given]:
        if reference is not None:
            yield from read_weights(reference, stage).about.captures


def refuse_trained_on(
    detectors: Iterable[DetectorConfig], captures: Iterable[tuple[str, Capture | CaptureRef | RunRef]]
) -> None:
    """Refuse to score detectors on captures that share content, recording or draws with what they were trained on.

    Parameters
    ----------
    detectors : iterable of DetectorConfig
    captures : iterable of (str, Capture, CaptureRef or RunRef)
        With a name for people; opened only where a detector has learned anything.

    Raises
    ------
    ConfigError
        That names detector and captures.
    """
    learned = {one.name: known for one in detectors if (known := trained_on(one)).names}
    if not learned:
        return
    found: dict[str, list[str]] = {}
    for name, given in captures:
        try:
            opened = given if isinstance(given, Capture) else given.open()
        except BaseException as error:
            if not by_plugin(error):
                raise
            continue  # it will fail in the same way where it is to be scored, and say so
        for detector, known in learned.items():
            others = map(known.same, opened.captures if isinstance(opened, Drive) else (opened,))
            if (other := next(filter(None, others), None)) is not None:
                found.setdefault(detector, []).append(f"'{name}' (there '{other}')")
    for detector, pairs in found.items():
        more = f" and {len(pairs) - 3} more" if len(pairs) > 3 else ""
        raise ConfigError(
            f"detector '{detector}' was trained on recordings that would be scored: {', '.join(pairs[:3])}{more}; its "
            "results would say nothing about other recordings: leave these captures out, or train it on others"
        )
