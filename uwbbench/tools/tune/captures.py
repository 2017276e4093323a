"""Captures of a tuning: opened, recognised by their content, and sorted into the groups that are tuned separately."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from uwbbench.api.capture import Capture
from uwbbench.api.errors import ConfigError, ScoringError
from uwbbench.config.datasets import DatasetSource
from uwbbench.run.experiment import Experiment
from uwbbench.tools.tune.config import By


@dataclass(frozen=True)
class Labelled:
    """A capture with what it belongs to.

    Attributes
    ----------
    dataset : str
        Label of its dataset.
    capture : Capture
    scene : str
        Scene or set-up that it is of: captures of one scene repeat one another.
    """

    dataset: str
    capture: Capture
    scene: str = ""

    @property
    def text(self) -> str:
        """Dataset and name, for people."""
        return f"{self.dataset}: {self.capture.name}"

    @property
    def materials(self) -> tuple[str, ...]:
        """Materials of its obstacles, walls left out."""
        truth = self.capture.truth
        return tuple(sorted({item.material for item in truth.objects if not item.structure})) if truth else ()


@dataclass(frozen=True)
class Group:
    """Captures that are tuned together.

    Attributes
    ----------
    material : str or None
        Material of all their obstacles; None for any.
    channel : int or None
        None for any.
    tuning, held_out : tuple of Labelled
    """

    material: str | None
    channel: int | None
    tuning: tuple[Labelled, ...]
    held_out: tuple[Labelled, ...]

    @property
    def name(self) -> str:
        """Short name, for tables and files."""
        parts = [self.material or "", "" if self.channel is None else f"ch{self.channel}"]
        return "-".join(part for part in parts if part) or "overall"

    @property
    def text(self) -> str:
        """The group in words."""
        parts = [self.material or "", "" if self.channel is None else f"channel {self.channel}"]
        return ", ".join(part for part in parts if part) or "all captures"


def opened(sources: Iterable[DatasetSource]) -> tuple[Labelled, ...]:
    """Captures of datasets.

    Raises
    ------
    CaptureError
        If a dataset is empty, or a file missing or broken.
    ScoringError
        If a capture has no ground truth.
    """
    labelled = []
    for source in sources:
        references = source.references()
        scenes = source.scenes([ref.name for ref in references])
        labelled += [Labelled(source.label, ref.open(), f"{source.label}: {scenes[ref.name]}") for ref in references]
    for one in labelled:
        if one.capture.truth is None:
            raise ScoringError(f"{one.text}: has no ground truth, so nothing can be tuned or shown on it")
    return tuple(labelled)


def refuse_leaks(tuning: Sequence[Labelled], held_out: Sequence[Labelled], experiment: Experiment | None) -> None:
    """Refuse to tune on what is scored: on captures that are held out, or that an experiment scores.

    Captures are compared by their content, whatever their names and files are.

    Parameters
    ----------
    tuning, held_out : sequence of Labelled
    experiment : Experiment or None
        Experiment that will score the tuned detectors; None where there is none.

    Raises
    ------
    ConfigError
        That names the captures.
    """
    known = {one.capture.sha256: one for one in tuning}
    both = [one for one in held_out if one.capture.sha256 in known]
    if both:
        pairs = _pairs(both, known)
        raise ConfigError(f"captures are both tuned on and held out: {pairs}; a result on them would prove nothing")
    if experiment is None:
        return
    scored = [Labelled(source.label, ref.open()) for source in experiment.datasets for ref in source.references()]
    both = [one for one in scored if one.capture.sha256 in known]
    if both:
        pairs = _pairs(both, known)
        raise ConfigError(
            f"experiment '{experiment.name}' scores captures that would be tuned on: {pairs}; its results would then "
            "say nothing about other recordings: tune on others, or leave these out of the experiment"
        )


def _pairs(both: Sequence[Labelled], known: dict[str, Labelled]) -> str:
    shown = [f"'{one.text}' (here '{known[one.capture.sha256].text}')" for one in both[:3]]
    return ", ".join(shown) + (f" and {len(both) - 3} more" if len(both) > 3 else "")


def grouped(by: Sequence[By], tuning: Sequence[Labelled], held_out: Sequence[Labelled]) -> tuple[Group, ...]:
    """Groups of the tuning captures, each with the held-out captures of its kind.

    Captures with obstacles of several materials belong to no material.

    Parameters
    ----------
    by : sequence of {"overall", "material", "channel", "material-channel"}
        What groups are made by.
    tuning, held_out : sequence of Labelled

    Returns
    -------
    tuple of Group
        Those with at least one tuning capture.
    """
    materials = sorted({one.materials[0] for one in tuning if len(one.materials) == 1})
    channels = sorted({one.capture.radar.channel for one in tuning if one.capture.radar.channel is not None})
    wanted: list[tuple[str | None, int | None]] = []
    for kind in by:
        of_material = materials if kind in ("material", "material-channel") else [None]
        of_channel = channels if kind in ("channel", "material-channel") else [None]
        wanted += [(material, channel) for material in of_material for channel in of_channel]
    groups = [
        Group(material, channel, _of(tuning, material, channel), _of(held_out, material, channel))
        for material, channel in wanted
    ]
    return tuple(group for group in groups if group.tuning)


def _of(captures: Sequence[Labelled], material: str | None, channel: int | None) -> tuple[Labelled, ...]:
    return tuple(
        one
        for one in captures
        if (material is None or one.materials == (material,))
        and (channel is None or one.capture.radar.channel == channel)
    )
