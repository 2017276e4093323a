"""A mapper: the kind of plugin that answers with poses and a map, from what one or more receivers of a robot find."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, Literal, get_args

import numpy as np

from uwbbench.api.anchors import Messages
from uwbbench.api.arrays import FloatArray, IntArray, lock_fields
from uwbbench.api.detections import Detections
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Fidelity, P, Params, params_type_of
from uwbbench.api.truth import Trajectory, Truth

LandmarkKind = Literal["point", "line", "anchor"]
LANDMARK_KINDS: tuple[LandmarkKind, ...] = get_args(LandmarkKind)


@dataclass(frozen=True)
class Step:
    """One tick of the robot's clock, as a mapper is given it; nothing in it is changed in place.

    Attributes
    ----------
    index : int
        Number of the step in its run, from 0.
    time_s : float
    moved : (3,) array
        Odometry since the step before, in the robot's frame there: forward and leftward in metres, turn in radians.
        Zeros in the first step.
    found : mapping of str to Detections
        Rows of the front end of each receiver that has a frame in this step; their ``frame`` is ``index``.
    messages : mapping of str to Messages
        By receiver; those that heard nothing are left out.
    """

    index: int
    time_s: float
    moved: FloatArray
    found: Mapping[str, Detections]
    messages: Mapping[str, Messages] = field(default_factory=dict)


@dataclass(frozen=True)
class Poses:
    """Poses of the robot in the plane; read-only.

    Attributes
    ----------
    index : (n,) int array
        Steps of the run, increasing.
    pose : (n, 3) array
        x and y in metres, yaw in radians.
    covariance : (n, 3, 3) array or None
        Of these three; None where the mapper does not say.
    """

    index: IntArray
    pose: FloatArray
    covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        lock_fields(self, ("index", "pose", "covariance"))

    def __len__(self) -> int:
        return len(self.index)

    @classmethod
    def of_one(cls, index: int, pose: FloatArray, covariance: FloatArray | None = None) -> Poses:
        """One pose.

        Parameters
        ----------
        index : int
            Its step.
        pose : (3,) array
        covariance : (3, 3) array, optional
        """
        many = None if covariance is None else np.array(covariance, dtype=np.float64)[None]
        return cls(np.array([index]), np.array(pose, dtype=np.float64)[None], many)

    @classmethod
    def none(cls) -> Poses:
        """No pose."""
        return cls(np.zeros(0, np.int64), np.zeros((0, 3)))

    def records(self) -> list[dict[str, Any]]:
        """Poses as plain values, one mapping for each: what a program without arrays reads."""
        names = ("step", "x_m", "y_m", "yaw_rad")
        return [
            dict(zip(names, row, strict=True)) for row in zip(self.index.tolist(), *self.pose.T.tolist(), strict=True)
        ]

    @staticmethod
    def join(parts: list[Poses]) -> Poses:
        """Poses of parts that follow one another; without covariance where one of them has none."""
        parts = [part for part in parts if len(part)]
        if not parts:
            return Poses.none()
        known = [part.covariance for part in parts if part.covariance is not None]
        covariance = np.concatenate(known) if len(known) == len(parts) else None
        return Poses(
            np.concatenate([part.index for part in parts]), np.concatenate([part.pose for part in parts]), covariance
        )


@dataclass(frozen=True)
class Landmarks:
    """What a mapper knows again when it sees it; read-only.

    Attributes
    ----------
    identity : (n,) int array
        Number of each; that of an anchor is the one that its messages carry.
    kind : (n,) int array
        Place in :data:`LANDMARK_KINDS`.
    a, b : (n,) array
        x and y in metres of a point or an anchor; of a line its distance from the origin in metres and the direction of
        its normal in radians.
    covariance : (n, 2, 2) array
        Of ``a`` and ``b``.
    support : (n,) int array
        Observations that each is made of.
    """

    identity: IntArray
    kind: IntArray
    a: FloatArray
    b: FloatArray
    covariance: FloatArray
    support: IntArray

    def __post_init__(self) -> None:
        lock_fields(self, ("identity", "kind", "a", "b", "covariance", "support"))

    def __len__(self) -> int:
        return len(self.identity)

    @classmethod
    def none(cls) -> Landmarks:
        """No landmark."""
        whole, real = np.zeros(0, np.int64), np.zeros(0)
        return cls(whole, whole, real, real, np.zeros((0, 2, 2)), whole)

    def of(self, kind: LandmarkKind) -> Landmarks:
        """Those of one kind."""
        rows = self.kind == LANDMARK_KINDS.index(kind)
        columns = (self.identity, self.kind, self.a, self.b, self.covariance, self.support)
        return Landmarks(*(column[rows] for column in columns))

    @property
    def position_m(self) -> FloatArray:
        """X and y (n, 2) of points and anchors."""
        return np.column_stack([self.a, self.b])


@dataclass(frozen=True)
class Grid:
    """Cells of the plane with how probably each is occupied; read-only.

    Attributes
    ----------
    origin_m : (2,) array
        Corner of smallest x and y.
    cell_m : float
        Side of a cell.
    log_odds : (rows, columns) array
        Natural logarithm of the odds that a cell is occupied, 0 where nothing is known; rows along y.
    """

    origin_m: FloatArray
    cell_m: float
    log_odds: FloatArray

    def __post_init__(self) -> None:
        lock_fields(self, ("origin_m", "log_odds"))


@dataclass(frozen=True)
class Map:
    """What a mapper has learnt of the surroundings, in the frame that its poses are in; read-only.

    Attributes
    ----------
    landmarks : Landmarks
    segments_m : (k, 2, 2) array
        Straight pieces with known ends.
    points_m : (m, 2) array
        Points that belong to surfaces.
    grid : Grid or None
    """

    landmarks: Landmarks = field(default_factory=Landmarks.none)
    segments_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2, 2)))
    points_m: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    grid: Grid | None = None

    def __post_init__(self) -> None:
        lock_fields(self, ("segments_m", "points_m"))


@dataclass(frozen=True)
class Mapped:
    """All that a mapper made of a run.

    Attributes
    ----------
    poses : Poses
        Handed out on the way.
    map : Map
        At the end.
    smoothed : Poses or None
        The trajectory as the mapper knows it at the end, where it looks back.
    """

    poses: Poses
    map: Map
    smoothed: Poses | None = None


class Mapper(Generic[P]):
    """The back end of a detector that answers with poses and a map.

    Every receiver of a run has a front end, a chain of stages; their detections come together here, one :class:`Step`
    at a time, with what odometry says. The true pose is withheld: the front ends' frames carry the odometry in its
    place. A mapper sees a step when all front ends have answered for it, so that its answer does not hang on how the
    frames were cut. State lives on the instance and starts in :meth:`open`; an instance serves one run.

    Class attributes
    ----------------
    consumes : frozenset of str
        Columns that the front ends must have made, such as ``range_m`` and ``azimuth_rad``.
    needs : frozenset of str
        What the run must have besides odometry: ``anchors``, or ``truth``, which references alone ask for.
    receivers : int
        Fewest receivers that it works with.
    fidelity : str
        As of a :class:`~uwbbench.api.stage.Stage`.

    Attributes
    ----------
    notes : list of str
        What a reader of the results must know, such as that the filter has diverged.
    """

    consumes: ClassVar[frozenset[str]] = frozenset(("range_m",))
    needs: ClassVar[frozenset[str]] = frozenset()
    receivers: ClassVar[int] = 1
    fidelity: ClassVar[Fidelity] = "baseline"

    def __init__(self, params: P) -> None:
        self.params: P = params
        self.notes: list[str] = []

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return params_type_of(cls, Mapper)

    def open(self, radars: Mapping[str, Radar], start: Poses) -> None:  # noqa: ARG002
        """Start a run. Overriders call this first.

        Parameters
        ----------
        radars : mapping of str to Radar
            By receiver, in the order of the run.
        start : Poses
            One pose, that of the first step: where odometry begins. The map is in its frame.
        """
        self.notes = []

    def show_truth(self, truth: Truth, trajectory: Trajectory) -> None:
        """Receive the ground truth; called after :meth:`open`, only for mappers that need ``truth``.

        Parameters
        ----------
        truth : Truth
        trajectory : Trajectory
            True poses, one for each step.
        """

    def step(self, step: Step) -> Poses:
        """Poses that are known after this step: usually one, its own."""
        raise NotImplementedError

    def finish(self) -> tuple[Poses | None, Map]:
        """The trajectory as it is known now, where the mapper looks back, else None; and the map. Ends the run."""
        raise NotImplementedError

    def note(self, text: str) -> None:
        """Add a note for the reader of the results, once."""
        if text not in self.notes:
            self.notes.append(text)
