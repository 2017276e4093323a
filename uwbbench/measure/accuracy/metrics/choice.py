"""Which metrics a run shows, in which order, and which of them ranks: all stated by the metrics themselves.

Conventions
-----------
* Every run shows the installed metrics whose ``default`` is true, and those that its experiment lists.
* They stand in the metrics' own ``order``. The *headline* ones, for where room or time is short, are the listed ones in
  the order of the list, then the default ones by their ``headline``.
* The first listed metric ranks; where it has no better end, or is undefined on a board, the first default headline
  metric that can.
* A listed metric that cannot be loaded is not dropped: :class:`Absent` stands for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar, Literal

from uwbbench.api import registry
from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import PluginError
from uwbbench.api.metric import Metric, Outcome

MOST_COMPARED = 3
"""Default headline metrics in which detectors are compared in pairs."""


class Absent(Metric):
    """Stands for a metric that is not installed: undefined whatever the outcomes, and shown by its plain name."""

    merge: ClassVar[Literal["sum", "stack"]] = "stack"
    better: ClassVar[Literal["higher", "lower", "zero"]] = "zero"

    @staticmethod
    def partial(outcome: Outcome) -> FloatArray:
        """No samples."""
        return outcome.error_m[:0]

    @staticmethod
    def value(partial: FloatArray) -> float:  # noqa: ARG004 - whatever it is made of
        """NaN."""
        return math.nan


class MetricChoice(Mapping[str, type[Metric]]):
    """Metrics of a run by registered name, in their own order.

    Parameters
    ----------
    listed : sequence of str
        Names that the experiment lists.

    Attributes
    ----------
    listed : tuple of str
        The same, each once.
    absent : tuple of str
        Listed ones that could not be loaded.
    notes : tuple of str
        What could not be loaded, and why.
    """

    def __init__(self, listed: Sequence[str] = ()) -> None:
        chosen: dict[str, type[Metric]] = {}
        notes = []
        for name in dict.fromkeys([*listed, *registry.entries("metrics")]):
            try:
                metric = load_metric(name)
            except PluginError as error:
                notes.append(str(error))
                metric = Absent
            if name in listed or metric.default:
                chosen[name] = metric
        self._by_name = dict(sorted(chosen.items(), key=lambda item: item[1].order))
        places = {name: metric.headline for name, metric in self.items() if metric.default}
        self._leading = [name for _, name in sorted((at, name) for name, at in places.items() if at is not None)]
        self.listed = tuple(dict.fromkeys(listed))
        self.absent = tuple(name for name in self.listed if chosen[name] is Absent)
        self.notes = tuple(notes)

    def __getitem__(self, name: str) -> type[Metric]:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)

    def defined(self, *, exhaustive: bool) -> list[str]:
        """Names of those that have a meaning where the truth is exhaustive, or is not."""
        return self._meaningful(self, exhaustive)

    @property
    def brief(self) -> dict[str, type[Metric]]:
        """Those of tables that must be narrow."""
        return {name: metric for name, metric in self.items() if metric.brief or name in self.listed}

    def headline(self, *, exhaustive: bool) -> list[str]:
        """Names of the few that are charted."""
        return self._meaningful([*self.listed, *self._leading], exhaustive)

    def compared(self, *, exhaustive: bool) -> list[str]:
        """Names of those that detectors are compared in, in pairs: headline ones, as there are many pairs."""
        return self._meaningful([*self.listed, *self._leading[:MOST_COMPARED]], exhaustive)

    def ranking(self, *, exhaustive: bool) -> str:
        """Name of the metric that ranks.

        Raises
        ------
        PluginError
            If none that can was loaded.
        """
        for name in self._meaningful([*self.listed[:1], *self._leading], exhaustive):
            if self[name].better != "zero":
                return name
        raise PluginError("; ".join(self.notes) or "no installed metric can rank detectors")

    def error(self, *, exhaustive: bool) -> list[str]:
        """Name of the headline metric of errors that stands beside the one that ranks, if there is any."""
        main = self.ranking(exhaustive=exhaustive)
        names = self.headline(exhaustive=exhaustive)
        return [name for name in names if name != main and self[name].merge == "stack"][:1]

    def _meaningful(self, names: Iterable[str], exhaustive: bool) -> list[str]:
        return [name for name in dict.fromkeys(names) if exhaustive or not self[name].needs_exhaustive_truth]


def load_metric(name: str) -> type[Metric]:
    """Metric behind a registered name.

    Raises
    ------
    PluginError
        If it cannot be loaded, or is no metric.
    """
    metric: type[Metric] = registry.load_plugin("metrics", name)
    if not issubclass(metric, Metric):
        known = registry.entry("metrics", name)
        raise PluginError(f"metric '{name}' of {known.package}: {known.target} is no subclass of uwbbench.api.Metric")
    return metric
