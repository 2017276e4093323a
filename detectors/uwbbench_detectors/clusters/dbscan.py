"""Density-based clustering of detections in the world."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from uwbbench.api import Block, Detections, FloatArray, Frames, IntArray, Params, Radar, Stage, ports
from uwbbench_detectors.clusters.held import HeldRows

if TYPE_CHECKING:
    from uwbbench_detectors.clusters.rounds import GrowingRounds, WindowedRounds

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
    when: Literal["reached", "exceeded"] = Field(
        "reached",
        description="Whether re-clustering starts with the last of these new points or with the one after it: arXiv "
        "2512.01018 says 'after more than min_peaks peaks have been recorded' ('Complete pipeline visualisation'), and "
        "calls it the minimum number in its table of key parameters.",
    )
    window: int | None = Field(
        None,
        ge=1,
        description="Points that are clustered, counted back from the newest; null takes all so far, which costs no "
        "more time but memory for each. 50 with min_samples 20 leaves room for two clusters.",
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
            if self.window < max(self.period, self.min_samples):
                raise ValueError(
                    f"'window' must be at least 'every' ({self.period}), or points would never be clustered, and at "
                    f"least 'min_samples' ({self.min_samples}), or no cluster could form"
                )
        return self

    @property
    def period(self) -> int:
        """New points from one re-clustering to the next."""
        return self.every + (self.when == "exceeded")


class Dbscan(Stage[DbscanParams]):
    """DBSCAN over the world positions of all detections so far, again after every few new points.

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
    removes = ports("frames", "first_path", "noise", "profile", "aligned", "window_mean", "window_sd")
    fidelity = "from-source"

    def open(self, radar: Radar) -> None:
        """Start without points."""
        super().open(radar)
        self._held = HeldRows()
        self._new = 0  # points held that no re-clustering has seen
        self._origin_m: FloatArray | None = None  # the first point, once there is one
        self._rounds = self._start()
        self._frames: Frames | None = None
        self._no_detections: Detections | None = None
        self.clusterings: int = 0

    def step(self, block: Block) -> Block:
        """Block with the detections that are ready, their ``cluster`` filled in."""
        detections = block.detections
        self._frames = block.frames
        if self.params.labels == "final":
            self._held.add(detections)
            return block.replace(detections=self._none_of(detections))
        located = np.isfinite(detections["x_m"]) & np.isfinite(detections["y_m"])
        count = int(np.count_nonzero(located))
        all_located = count == len(detections)
        before = self._new
        self._held.add(detections if all_located else detections.take(located))
        self._new += count
        due = self._new - self._new % self.params.period
        if all_located and not due:
            return block.replace(detections=self._none_of(detections))
        columns, rounds = self._recluster(due)
        ready = Detections(**columns, processed=detections.processed, notes=detections.notes)
        if not all_located:
            # They come out at once: before what is released by the round that they arrived in.
            lost_in = ((before + np.cumsum(located)) // self.params.period)[~located]
            order = np.argsort(np.concatenate([lost_in, rounds]), kind="stable")
            ready = Detections.join([_with_cluster(detections.take(~located), NOISE), ready]).take(order)
        return block.replace(detections=ready)

    def flush(self) -> Block | None:
        """Block without frames that holds all that was held back."""
        if self._frames is None:
            return None
        no_frames = self._frames.part(len(self._frames), len(self._frames))
        if self.params.labels == "final":
            held = Detections(**self._held.release_all(), processed=())
            return Block(no_frames, detections=held.with_columns(cluster=self._final_clusters(held)))
        clustered, _ = self._recluster(self._new)
        noise = _with_cluster(Detections(**self._held.release_all(), processed=()), NOISE)
        return Block(no_frames, detections=Detections.join([Detections(**clustered, processed=()), noise]))

    def _start(self) -> GrowingRounds | WindowedRounds:
        from uwbbench_detectors.clusters.rounds import GrowingRounds, WindowedRounds  # compiled

        params = self.params
        if params.window is None:
            return GrowingRounds(params.eps_m, params.min_samples, params.period)
        return WindowedRounds(params.eps_m, params.min_samples, params.period, params.window)

    def _none_of(self, detections: Detections) -> Detections:
        """Detections without rows, prepared once: most calls release nothing."""
        if self._no_detections is None or self._no_detections.names != (*detections.names, "cluster"):
            self._no_detections = _with_cluster(detections.take(np.empty(0, np.int64)), NOISE).annotated(
                processed=np.empty(0, np.int64)
            )
        return self._no_detections

    def _recluster(self, count: int) -> tuple[dict[str, Any], IntArray]:
        """Cluster the first of the new points; columns of what that decides, and the round that did."""
        if not count:
            empty = np.empty(0, np.int64)
            return {**self._held.release(empty), "cluster": empty}, empty
        points_m = self._held.points_m(self._new)[:count]
        if self._origin_m is None:
            self._origin_m = points_m[0]
        # Map coordinates of millions of metres would cost digits.
        decided = self._rounds.extend(points_m - self._origin_m)
        self._new -= count
        self.clusterings += -(-count // self.params.period)
        return {**self._held.release(decided.points), "cluster": decided.clusters}, decided.rounds

    def _final_clusters(self, held: Detections) -> IntArray:
        from uwbbench_detectors.clusters.incremental import dbscan  # compiled

        points_m = np.stack([held["x_m"], held["y_m"]], axis=1)
        located = np.isfinite(points_m).all(axis=1)
        clusters = np.full(len(held), NOISE)
        if located.any():
            points_m = points_m[located]
            clusters[located], _ = dbscan(points_m - points_m[0], self.params.eps_m, self.params.min_samples)
        return clusters


def _with_cluster(detections: Detections, number: int) -> Detections:
    return detections.with_columns(cluster=np.full(len(detections), number))
