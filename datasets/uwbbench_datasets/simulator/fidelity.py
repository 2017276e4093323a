"""Which terms of a scene are worth synthesising: those that the noise does not cover."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from uwbbench.api import Term, View
from uwbbench_datasets.simulator.scene import FidelityModel

Reason = Literal["needed", "above the margin", "forced", "below the margin"]


@dataclass(frozen=True)
class Contribution:
    """What became of one term for one receiver.

    Attributes
    ----------
    name : str
    reason : str
        ``needed`` where the term cannot be left out, ``above the margin``, ``forced``, or ``below the margin``: left
        out.
    level_db : float or None
        Bound of its amplitude over the root mean square of the noise; None where it has no bound or nothing is noisy.
    pulses : int
        Pulses that were synthesised for it, over all frames.
    seconds : float
        Time it took, preparation included.
    """

    name: str
    reason: Reason
    level_db: float | None = None
    pulses: int = 0
    seconds: float = 0.0

    @property
    def kept(self) -> bool:
        """Whether the term was synthesised."""
        return self.reason != "below the margin"

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**dataclasses.asdict(self), "kept": self.kept}

    def __str__(self) -> str:
        """Name, level and cost on one line; no times, which differ between two equal simulations."""
        level = [] if self.level_db is None else [f"{self.level_db:+.1f} dB"]
        forced = ["forced"] if self.reason == "forced" else []
        return " ".join([self.name, *level, *forced, *([f"{self.pulses} pulses"] if self.pulses else [])])


def described(contributions: Sequence[Contribution]) -> str:
    """Which terms a capture consists of and which it lacks, for the description in its file."""
    kept = ", ".join(str(one) for one in contributions if one.kept)
    lacking = ", ".join(str(one) for one in contributions if not one.kept)
    return f"terms, with their bound over the noise and their cost: {kept}" + (
        f"; left out: {lacking}" if lacking else ""
    )


def choose(terms: Sequence[tuple[str, Term[Any]]], view: View, model: FidelityModel) -> list[Contribution]:
    """Decide about each term, before anything is synthesised.

    Parameters
    ----------
    terms : sequence of (str, Term)
        Names and prepared terms.
    view : View
        All frames.
    model : FidelityModel

    Returns
    -------
    list of Contribution
        In the order given.
    """
    floor = float(np.sqrt(sum(term.noise_rms(view) ** 2 for _, term in terms)))
    return [_decided(name, term.bound(view), floor, model) for name, term in terms]


def _decided(name: str, bound: float | None, floor: float, model: FidelityModel) -> Contribution:
    if bound is None or floor == 0:
        return Contribution(name, "needed")
    level_db = float(20 * np.log10(max(bound, np.finfo(float).tiny) / floor))
    if level_db > -model.margin_db:
        return Contribution(name, "above the margin", level_db)
    if model.mode == "all" or name in model.force:
        return Contribution(name, "forced", level_db)
    return Contribution(name, "below the margin", level_db)
