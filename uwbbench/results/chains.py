"""Detections left behind each step of a detector: the counts that arXiv 2512.01018 gives of its demonstration."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING

from uwbbench.measure.accuracy.counts import reach_of_mean
from uwbbench.run.folder.folder import RunFolder
from uwbbench.run.folder.journal import Entry

if TYPE_CHECKING:
    import pandas as pd

    from uwbbench.api.detections import Detections

IN_CLUSTERS = "in clusters"
"""Step behind the last one: detections that a cluster holds."""


def in_clusters(detections: Detections) -> int | None:
    """Detections that a cluster holds; None where nothing clusters them."""
    return int((detections["cluster"] >= 0).sum()) if "cluster" in detections else None


def chains_of(folder: RunFolder, entries: Iterable[Entry]) -> pd.DataFrame:
    """One row for each detector, dataset and step, in the order of the experiment.

    ``count`` is of all captures together; ``mean``, ``low`` and ``high`` are of one capture, over ``captures``.

    Parameters
    ----------
    folder : RunFolder
    entries : iterable of Entry
        Accuracy entries that were done.
    """
    import pandas as pd

    counts: dict[tuple[str, str, str], list[int]] = defaultdict(list)
    for entry in entries:
        for step, count in entry.facts["chain"].items():
            counts[entry.detector, entry.dataset, step].append(count)
        clustered = in_clusters(folder.detections(entry.unit))
        if clustered is not None:
            counts[entry.detector, entry.dataset, IN_CLUSTERS].append(clustered)
    columns = ["detector", "dataset", "step", "count", "captures", "mean", "low", "high"]
    rows = []
    for key, each in counts.items():
        mean, reach = sum(each) / len(each), reach_of_mean(each)
        rows.append((*key, sum(each), len(each), mean, mean - reach, mean + reach))
    experiment = folder.manifest["experiment"]
    detectors = [config["name"] for config in experiment["detectors"]]
    datasets = [used["label"] for used in experiment["datasets"]]
    rows.sort(key=lambda row: (detectors.index(row[0]), datasets.index(row[1])))
    return pd.DataFrame(rows, columns=columns)
