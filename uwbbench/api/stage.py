"""One step of a detector: what a stage declares, and what it does with a block of frames."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar, Generic, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict

from uwbbench.api.arrays import BoolArray
from uwbbench.api.block import Block
from uwbbench.api.radar import Radar
from uwbbench.api.text import summary
from uwbbench.api.truth import Trajectory, Truth

Fidelity = Literal["from-source", "reconstruction", "baseline", "reference"]
"""Where an algorithm comes from: a source that was read, a reconstruction in kind, a textbook, or no detector."""


class Params(BaseModel):
    """Parameters of a plugin: unknown keys are errors, values are checked, nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


P = TypeVar("P", bound=Params)


def params_type_of(cls: type, base: type) -> type[Params]:
    """Parameter model that ``cls`` names as ``base[Model]``, looked up along its bases."""
    for ancestor in cls.__mro__:
        for generic in getattr(ancestor, "__orig_bases__", ()):
            arguments = get_args(generic)
            origin = get_origin(generic)
            if arguments and isinstance(origin, type) and issubclass(origin, base) and isinstance(arguments[0], type):
                model: type[Params] = arguments[0]
                return model
    return Params


class Stage(Generic[P]):
    """One step of a detector.

    A stage is written once, for a block of consecutive frames of any length; the stream hands it short blocks, the
    batch a long one, and both must give the same answer for any cut. State between blocks lives on the instance and
    starts in :meth:`open`; an instance serves one stream.

    Class attributes
    ----------------
    consumes : frozenset of str
        Ports that an earlier stage must have produced.
    produces : frozenset of str
        Ports that later stages may use: ``first_path``, ``noise``, ``profile``, ``aligned``, ``window_mean``,
        ``window_sd``, ``features``, ``detections``, or the name of a column of detections.
    removes : frozenset of str
        Ports that are gone behind this stage, for example ``frames`` where detections are held back.
    needs : frozenset of str
        What the capture must have: ``sts``, ``truth``, a reported ``first_path`` or a ``background``. A batch reads STS
        responses only where a stage needs them.
    rowwise : bool
        True where each detection's new columns depend on that row and its frame alone. Rejected candidates are then
        described in the same way, for scorings that ask what the filters removed.
    implied : bool
        True where the stage may be put into a detector whose file leaves it out, with its defaults and a note: it is
        the default maker of a port that a step consumes and no step makes.
    fidelity : str
        ``from-source``, ``reconstruction``, ``baseline`` or ``reference``.

    Attributes
    ----------
    clusterings : int or None
        How often the stage has clustered since it was opened, so that those calls can be timed apart; None where it
        does not cluster.
    """

    consumes: ClassVar[frozenset[str]] = frozenset()
    produces: ClassVar[frozenset[str]] = frozenset()
    removes: ClassVar[frozenset[str]] = frozenset()
    needs: ClassVar[frozenset[str]] = frozenset()
    rowwise: ClassVar[bool] = False
    implied: ClassVar[bool] = False
    fidelity: ClassVar[Fidelity] = "baseline"

    clusterings: int | None = None

    def __init__(self, params: P) -> None:
        self.params: P = params
        self.notes: list[str] = []
        self.radar: Radar

    @classmethod
    def params_type(cls) -> type[Params]:
        """Pydantic model of the parameters."""
        return params_type_of(cls, Stage)

    @property
    def wanted(self) -> frozenset[str]:
        """Ports that this stage looks at; overridden where some of its parameters make it look at more."""
        return self.consumes

    @classmethod
    def needs_with(cls, params: Params) -> frozenset[str]:  # noqa: ARG003
        """What the capture must have where the stage has these parameters; overridden where that hangs on them.

        Parameters
        ----------
        params : Params
            Checked parameters of this stage.
        """
        return cls.needs

    @property
    def every_nth(self) -> bool:
        """Whether the stage looks at every n-th frame alone, so that its answer hangs on which frames were lost."""
        return False

    @property
    def whole_windows(self) -> bool:
        """Whether the stage answers for a window of frames as a whole, so that its answer hangs on all of them."""
        return False

    @property
    def resolves_taps(self) -> float:
        """Largest distance at which two equal echoes are not taken for noise by each other, by how the method works.

        Asked of an opened stage.
        """
        return math.inf

    def recalibrated(self, column: str, offset: float) -> dict[str, float]:  # noqa: ARG002
        """Parameters of a stage that takes ``offset`` more off a column than this one does.

        Parameters
        ----------
        column : str
            Column of detections, such as ``range_m``; ``preamble_delay_s``, ``sts1_delay_s`` and ``sts2_delay_s`` are
            the delays of the direct path behind the crest of each response.
        offset : float
            In SI units.

        Returns
        -------
        dict
            Values by the names of parameters; empty where the stage takes no offset off this column.

        Raises
        ------
        ConfigError
            If nothing can be added to what the parameters say; the message starts with the name of the parameter.
        """
        return {}

    def open(self, radar: Radar) -> None:
        """Start a stream: set the state that lives between blocks. Overriders call this first."""
        self.radar = radar
        self.notes = []

    def show_truth(self, truth: Truth, trajectory: Trajectory) -> None:
        """Receive the ground truth; called only for stages that need ``truth``, which no real detector does."""

    def show_background(self, blocks: Iterable[Block]) -> None:
        """Receive what the radar records with nothing in view; called for stages that need a ``background``.

        Whether a stage does may hang on its parameters, as :meth:`needs_with` says.

        Parameters
        ----------
        blocks : iterable of Block
            Frames of the background capture in order, as the steps before this one leave them; read once.
        """

    def step(self, block: Block) -> Block:
        """Block with what this stage adds; may cover other frames than it was given, if it holds some back."""
        raise NotImplementedError

    def flush(self) -> Block | None:
        """Whatever is still held back at the end of the stream."""
        return None

    def note(self, text: str) -> None:
        """Add a note for the reader of the results, once."""
        if text not in self.notes:
            self.notes.append(text)


class Filter(Stage[P]):
    """A stage that only drops detections."""

    rowwise: ClassVar[bool] = True

    def keep(self, block: Block) -> BoolArray:
        """Mask of the detections to keep. Write the condition that accepts, so that NaN is rejected."""
        raise NotImplementedError

    def step(self, block: Block) -> Block:
        """Block without the detections that :meth:`keep` drops."""
        return block.replace(detections=block.detections.take(self.keep(block)))


def ports(*names: str) -> frozenset[str]:
    """Set of port names, to declare what a stage consumes and produces."""
    return frozenset(names)


def describe(cls: type[Any]) -> str:
    """First paragraph of a plugin's docstring, as lists and reports show it."""
    return summary(cls.__doc__)
