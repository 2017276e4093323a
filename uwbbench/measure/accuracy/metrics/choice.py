"""Which metrics a run shows, in which order, and which of them ranks: all stated by the metrics themselves.

Conventions
-----------
* Every run shows the installed metrics whose ``default`` is true, and those that its experiment lists.
* An experiment that says where (``rank``, ``table``, ``charts``) has exactly those there, in its own order; what it
  leaves out stays as it is for everyone. The metric that ranks is always a column of the table, the first if need be.
* They stand in the metrics' own ``order``. The *headline* ones, for where room or time is short, are the listed ones in
  the order of the list, then the default ones by their ``headline``.
* The first listed metric ranks; where it has no better end, or is undefined on a board, the first default headline
  metric that can.
* In a scoring there are those metrics alone that take its outcomes; others are passed over there. Where a scoring has
  metrics of its own, narrow tables leave out the default ones of every scoring that are no headline.
* A listed metric that cannot be loaded is not dropped: :class:`Absent` stands for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal

from uwbbench.api import registry
from uwbbench.api.arrays import FloatArray
from uwbbench.api.errors import ConfigError, PluginError
from uwbbench.api.metric import Metric, Outcome
from uwbbench.measure.accuracy.rules import SCORINGS, applies

MOST_COMPARED = 3
"""Default headline metrics in which detectors are compared in pairs."""


Metrics = Sequence[str] | Mapping[str, Any]
"""Metrics as an experiment has them: those besides the default ones, or exactly which are shown where."""


def names_of(metrics: Metrics) -> list[str]:
    """Names of all metrics that an experiment has, each once.

    Examples
    --------
    >>> names_of({"rank": "recall", "table": ["f1", "recall"]})
    ['recall', 'f1']
    """
    if not isinstance(metrics, Mapping):
        return list(dict.fromkeys(metrics))
    rank = metrics.get("rank")
    names = [*([rank] if rank else []), *(metrics.get("table") or ()), *(metrics.get("charts") or ())]
    return list(dict.fromkeys(names))


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
    metrics : sequence of str or mapping
        As the experiment has them: listed names, or names under ``rank``, ``table`` and ``charts``.
    scorings : sequence of str, optional
        Those that have a meaning in any of these; left out: those that have one in every scoring.

    Attributes
    ----------
    listed : tuple of str
        Those of its names that the experiment has, each once.
    absent : tuple of str
        Listed ones that could not be loaded.
    notes : tuple of str
        What could not be loaded, and why.
    """

    def __init__(self, metrics: Metrics = (), scorings: Sequence[str] = ()) -> None:
        chosen: dict[str, type[Metric]] = {}
        notes, asked = [], names_of(metrics)
        for name in dict.fromkeys([*asked, *registry.entries("metrics")]):
            try:
                metric = load_metric(name)
            except PluginError as error:
                notes.append(str(error))
                metric = Absent
            fits = any(applies(metric, scoring) for scoring in scorings) if scorings else metric.of is Outcome
            if fits and (name in asked or metric.default):
                chosen[name] = metric
        listed = [name for name in asked if name in chosen]
        self._metrics, self._by_scoring = metrics, dict[str, MetricChoice]()
        self._by_name = dict(sorted(chosen.items(), key=lambda item: item[1].order))
        own = {name for name, metric in self.items() if metric.of is not Outcome and len(scorings) == 1}
        places = {name: metric.headline for name, metric in self.items() if metric.default}
        leading = sorted((at, name not in own, name) for name, at in places.items() if at is not None)
        self._leading = [name for *_, name in leading]
        self._first, self._charts = listed, list[str]()
        self._table = list(self)
        self._narrow = [name for name in self if name in listed or self._is_narrow(name, bool(own))]
        self._exact = isinstance(metrics, Mapping)
        if isinstance(metrics, Mapping):
            first, charts, table = (
                [name for name in names if name in chosen]
                for names in ([metrics.get("rank")], metrics.get("charts") or [], metrics.get("table") or [])
            )
            self._first, self._charts = first, charts
            self._table = table or [name for name in self if self[name].default]
            self._narrow = table or [name for name in self._table if self._is_narrow(name, bool(own))]
        self.listed = tuple(listed)
        self.absent = tuple(name for name in self.listed if chosen[name] is Absent)
        self.notes = tuple(notes)

    def of(self, scoring: str) -> MetricChoice:
        """Those that have a meaning in one scoring, with what ranks there."""
        if scoring not in self._by_scoring:
            self._by_scoring[scoring] = MetricChoice(self._metrics, [scoring])
        return self._by_scoring[scoring]

    def _is_narrow(self, name: str, crowded: bool) -> bool:
        """Whether a default metric stands in narrow tables; crowded: where the scoring has metrics of its own."""
        metric = self[name]
        leads = metric.headline is not None or (metric.beside in self and self[metric.beside].headline is not None)
        return metric.brief and (leads or not crowded or metric.of is not Outcome)

    def __getitem__(self, name: str) -> type[Metric]:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)

    def defined(self, *, exhaustive: bool) -> list[str]:
        """Names of those that have a meaning where the truth is exhaustive, or is not."""
        columns = self._meaningful(self._table, exhaustive)
        main = [self.ranking(exhaustive=exhaustive)] if self._exact else []
        return [*(name for name in main if name not in columns), *columns]

    @property
    def brief(self) -> dict[str, type[Metric]]:
        """Those of tables that must be narrow."""
        columns = dict.fromkeys([*(name for name in self._first[:1] if name not in self._narrow), *self._narrow])
        return {name: self[name] for name in columns}

    def headline(self, *, exhaustive: bool) -> list[str]:
        """Names of the few that are charted."""
        return self._meaningful(self._charts or [*self._first, *self._leading], exhaustive)

    def compared(self, *, exhaustive: bool) -> list[str]:
        """Names of those that detectors are compared in, in pairs: headline ones, as there are many pairs."""
        others = self._charts or self._leading[:MOST_COMPARED]
        return self._meaningful([*self._first, *others], exhaustive)

    def ranking(self, *, exhaustive: bool) -> str:
        """Name of the metric that ranks.

        Raises
        ------
        PluginError
            If none that can was loaded.
        """
        for name in self._meaningful([*self._first[:1], *self._leading], exhaustive):
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


def combined(experiments: Sequence[Metrics], scorings: Sequence[str] = ()) -> MetricChoice:
    """Choice of several experiments: theirs where they agree, else all that any of them has, besides the default ones.

    Parameters
    ----------
    experiments : sequence of sequence or mapping
        Metrics of each, the one that counts most first.
    scorings : sequence of str
        Those that have a meaning in any of these.
    """
    if experiments and all(metrics == experiments[0] for metrics in experiments):
        return MetricChoice(experiments[0], scorings)
    return MetricChoice([name for metrics in experiments for name in names_of(metrics)], scorings)


def check_applies(name: str, metric: type[Metric], scorings: Sequence[str]) -> None:
    """Refuse a metric that has no meaning in any of some scorings.

    Parameters
    ----------
    name : str
    metric : type of Metric
    scorings : sequence of str

    Raises
    ------
    ConfigError
        With the scorings that it is for.
    """
    if not any(applies(metric, scoring) for scoring in scorings):
        fitting = [f"'{scoring}'" for scoring in SCORINGS if applies(metric, scoring)]
        raise ConfigError(
            f"metric '{name}' has no meaning in the scoring {' or '.join(scorings)}: it is for {', '.join(fitting)}"
        )


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
