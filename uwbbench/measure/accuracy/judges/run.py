"""What the judges of whole runs share: who can be judged so, and how the estimate is laid over the truth."""

from __future__ import annotations

from typing import Any

import numpy as np

from uwbbench.api.arrays import FloatArray
from uwbbench.api.detections import Detections
from uwbbench.api.errors import ScoringError
from uwbbench.api.mapper import Mapped, Poses
from uwbbench.api.metric import Outcome
from uwbbench.config.rules import Table
from uwbbench.measure.accuracy.scene import Scene
from uwbbench.measure.accuracy.verdict import Verdict


def check_kind(detections: Detections, scoring: str, *, of_run: bool) -> None:
    """Refuse a mapper's detections where rows are counted, and those without a mapper where a run is judged.

    Parameters
    ----------
    detections : Detections
    scoring : str
        For the message.
    of_run : bool
        Whether the scoring is of a run.

    Raises
    ------
    ScoringError
        With what would do.
    """
    if of_run and detections.mapped is None:
        raise ScoringError(
            f"the detector hands out no poses and no map, which '{scoring}' is of: it has no 'mapper'; score it by "
            "'frame', 'peak', 'object' or 'latest'"
        )
    if not of_run and detections.mapped is not None:
        raise ScoringError(
            "the detector is a mapper, whose rows are of several receivers together; score it by 'pose' or 'map'"
        )


def trajectory_of(mapped: Mapped, scene: Scene, table: Table) -> tuple[Poses, FloatArray]:
    """Poses of a table, and the true pose (n, 3) of each.

    Parameters
    ----------
    mapped : Mapped
    scene : Scene
    table : {"filtering", "mapping"}
        Poses as they were handed out; or the smoothed ones, where there are any.

    Raises
    ------
    ScoringError
        If there are none, or they are not of this run, not in order or not finite.
    """
    smoothed = table == "mapping" and mapped.smoothed is not None
    poses = mapped.smoothed if smoothed and mapped.smoothed is not None else mapped.poses
    steps = len(scene.header)
    if not len(poses):
        raise ScoringError("the mapper has handed out no pose")
    wrong = poses.index[(poses.index < 0) | (poses.index >= steps)]
    if len(wrong):
        raise ScoringError(f"the poses name step {wrong[0]}, but run '{scene.header.name}' has {steps} steps")
    if np.any(np.diff(poses.index) <= 0):
        raise ScoringError("the steps of the poses do not rise")
    finite = np.isfinite(poses.pose).all(axis=1)
    if not finite.all():
        raise ScoringError(f"the pose of step {poses.index[np.argmin(finite)]} is not finite")
    track = scene.header.trajectory
    truth = np.column_stack([track.position_m[:, :2], track.yaw_rad])[poses.index]
    return poses, truth


def counted(scene: Scene, rows: int) -> dict[str, Any]:
    """What every outcome holds, of a run in which no detections are counted.

    Parameters
    ----------
    scene : Scene
    rows : int
        Of the outcome.
    """
    none = np.zeros(rows, np.int64)
    return {
        "group": none,
        "tp": none,
        "fp": none,
        "fn": none,
        "error_frame": np.zeros(0, np.int64),
        "error_m": np.zeros(0),
        "matched": np.zeros(0, bool),
        "duration_s": scene.header.duration_s,
        "exhaustive": scene.truth.exhaustive,
    }


def verdict(outcome: Outcome, detections: Detections, scene: Scene, duplicates: int = 0) -> Verdict:
    """Outcome of a run, of which no detection was judged.

    Parameters
    ----------
    outcome : Outcome
    detections : Detections
    scene : Scene
    duplicates : int
    """
    nothing = detections.take(np.zeros(len(detections), bool))
    return Verdict(
        outcome=outcome,
        true_empty=0,
        duplicates=duplicates,
        structure=0,
        unmatched=0,
        chance_recall=np.nan,
        retained=nothing,
        stray=np.zeros(0, bool),
        found=np.zeros(scene.labelled.shape, bool),
    )
