"""Density-based clustering of detections in the world."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, Detections, FloatArray, Frames, IntArray, Params, Radar, Stage, ports

NOISE = -1


class DbscanParams(Params):
    """What makes a cluster, and when clusters are sought."""

    eps_m: float = Field(
        0.20,
        gt=0,
        description="Neighbourhood radius. An azimuth error of 5 degrees exceeds 20 cm beyond 2.3 m, so that far "
        "objects fall apart.",
    )
    min_samples: int = Field(20, ge=1, description="Points in the neighbourhood of a core point, itself included.")
    every: int = Field(50, ge=1, description="New points that start a re-clustering.")
    window: int | None = Field(
        None,
        ge=1,
        description="Points that are clustered, counted back from the newest; null takes all so far, at a cost that "
        "grows with their number. 50 with min_samples 20 leaves room for two clusters.",
    )
    labels: Literal["causal", "final"] = Field(
        "causal",
        description="'causal' hands a detection out when a re-clustering first puts it into a cluster; 'final' hands "
        "all out at the end, with the clusters of all points.",
    )

    @model_validator(mode="after")
    def _check_window(self) -> Self:
        if self.window is not None:
            if self.labels == "final":
                raise ValueError("labels: final clusters all points; leave 'window' out")
            if self.window < max(self.every, self.min_samples):
                raise ValueError(
                    f"'window' must be at least 'every' ({self.every}), or points would never be clustered, and at "
                    f"least 'min_samples' ({self.min_samples}), or no cluster could form"
                )
        return self


class Dbscan(Stage[DbscanParams]):
    """DBSCAN over the world positions of all detections so far, again after every few new points.

    ``clusterings`` counts how often that happened, so that a benchmark can tell those calls from the others.

    A detection is held back until a re-clustering puts it into a cluster, and handed out with that cluster's number;
    over all points so far, membership is never lost, so that waiting is all it takes. What is still noise at the end,
    or when it leaves the ``window``, is handed out with -1, and so is at once a detection without position, which
    takes no part. Detections that one re-clustering releases come in their order of arrival.

    A cluster found again keeps its number, known by its core points; where clusters merge, the smallest one stays and
    what was handed out before keeps the old. Two clusters never get one number in the same re-clustering.

    References
    ----------
    Ester, Kriegel, Sander, Xu, A density-based algorithm for discovering clusters, KDD 1996; schedule and parameters
    of arXiv 2512.01018.
    """

    consumes = ports("detections", "x_m", "y_m")
    produces = ports("cluster")
    # Detections may come out long after their frames, so nothing that counts frames can follow.
    removes = ports("frames", "first_path", "noise", "profile")
    fidelity = "from-source"

    def open(self, radar: Radar) -> None:
        """Start without points."""
        super().open(radar)
        self._origin_m = np.empty((0, 2))  # the first point, once there is one
        self._new = 0
        self._points_m = np.empty((0, 2))
        self._ids = np.empty(0, np.int64)  # cluster of each point so far; NOISE marks exactly the points held back
        self._arrived: list[FloatArray] = []
        self._held: list[Detections] = []
        self._clusters = 0
        self.clusterings = 0
        self._no_frames: Frames | None = None

    def step(self, block: Block) -> Block:
        """Block with the detections that are ready, their ``cluster`` filled in."""
        found = block.detections
        self._no_frames = block.frames.part(len(block.frames), len(block.frames))
        released = [_labelled(found.take(np.empty(0, np.int64)), NOISE)]
        if self.params.labels == "final":
            self._held.append(found)
            return block.replace(detections=released[0])
        points_m = np.stack([found["x_m"], found["y_m"]], axis=1)
        located = np.isfinite(points_m).all(axis=1)
        due = located & ((self._new + np.cumsum(located)) % self.params.every == 0)
        for start, stop in pairwise([0, *(np.flatnonzero(due) + 1), len(found)]):
            rows = np.arange(start, stop)
            released.append(_labelled(found.take(rows[~located[rows]]), NOISE))
            self._hold(found.take(rows[located[rows]]), points_m[rows[located[rows]]])
            if self._new == self.params.every:
                released.append(self._recluster())
        return block.replace(detections=Detections.join(released))

    def flush(self) -> Block | None:
        """Block without frames that holds all that was held back."""
        if self._no_frames is None:
            return None
        if self.params.labels == "final":
            held = Detections.join(self._held)
            points_m = np.stack([held["x_m"], held["y_m"]], axis=1)
            located = np.isfinite(points_m).all(axis=1)
            clusters = np.full(len(held), NOISE)
            if located.any():
                clusters[located], _ = self._dbscan(points_m[located] - points_m[located][0])
            return Block(self._no_frames, detections=_labelled(held, clusters))
        clustered = self._recluster() if self._new else Detections.empty()
        noise = _labelled(Detections.join(self._held), NOISE)
        return Block(self._no_frames, detections=Detections.join([clustered, noise]))

    def _hold(self, found: Detections, points_m: FloatArray) -> None:
        if len(found) == 0:
            return
        self._origin_m = np.concatenate([self._origin_m, points_m])[:1]
        self._held.append(found)
        self._arrived.append(points_m - self._origin_m)  # map coordinates of millions of metres would cost digits
        self._new += len(points_m)

    def _recluster(self) -> Detections:
        """Cluster the points in the window, and release what is decided by that."""
        self.clusterings += 1
        arrived = np.concatenate(self._arrived)
        points_m = np.concatenate([self._points_m, arrived])
        ids = np.concatenate([self._ids, np.full(len(arrived), NOISE)])
        waiting = ids == NOISE
        left = len(points_m) - min(len(points_m), self.params.window or len(points_m))
        labels, core = self._dbscan(points_m[left:])
        ids[left:] = self._numbered(labels, core, ids[left:])
        decided = (ids != NOISE) | (np.arange(len(ids)) < left)

        held = Detections.join(self._held)
        self._held = [held.take(~decided[waiting])]
        self._points_m, self._ids = points_m[left:], ids[left:]
        self._arrived, self._new = [], 0
        return _labelled(held.take(decided[waiting]), ids[waiting & decided])

    def _dbscan(self, points_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Labels (n,) and indices of the core points."""
        from sklearn.cluster import DBSCAN  # takes longer to import than all else together

        # The tree decides distances that tie with eps as the definition says; brute force does not.
        model = DBSCAN(eps=self.params.eps_m, min_samples=self.params.min_samples, algorithm="kd_tree").fit(points_m)
        return np.asarray(model.labels_, dtype=np.int64), np.asarray(model.core_sample_indices_, dtype=np.int64)

    def _numbered(self, labels: IntArray, core: IntArray, ids: IntArray) -> IntArray:
        """Numbers (n,) that stay the same between re-clusterings; points that are noise now keep theirs.

        Core points alone carry a number on: a border point may lie between two clusters and change sides.
        """
        numbered = ids.copy()
        taken: set[int] = set()
        for label in range(int(labels.max(initial=NOISE)) + 1):
            known = set(ids[core[labels[core] == label]].tolist()) - taken - {NOISE}
            number = min(known, default=self._clusters)
            self._clusters = max(self._clusters, number + 1)
            taken.add(number)
            numbered[labels == label] = number
        return numbered


def _labelled(found: Detections, cluster: IntArray | int) -> Detections:
    return found.with_columns(cluster=np.broadcast_to(cluster, len(found)))
