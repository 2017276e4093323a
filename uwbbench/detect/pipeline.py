"""A detector assembled from stages: checked, opened on a receiver, run as a batch."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from uwbbench.api import registry
from uwbbench.api.block import Block
from uwbbench.api.capture import Capture, CaptureHeader
from uwbbench.api.detections import COLUMNS, Detections
from uwbbench.api.errors import ConfigError, PluginError
from uwbbench.api.frames import BATCH_FRAMES
from uwbbench.api.kernel import Kernel
from uwbbench.api.learning import LearnedParams
from uwbbench.api.radar import Radar
from uwbbench.api.stage import Stage
from uwbbench.api.weights import load_weights
from uwbbench.config.detector import DetectorConfig, Step, detector_from_text, read_detector
from uwbbench.config.identity import KERNEL, MAPPER, detector_identity, inside, named_within
from uwbbench.config.weights import portable_weights
from uwbbench.detect.hand_out import with_hand_outs
from uwbbench.detect.opening import Chosen, background_of, opened
from uwbbench.detect.sources import source_hash
from uwbbench.detect.stream import Opened, Stream

_NEEDS = {
    "sts": "STS responses of two antennas",
    "truth": "ground truth",
    "first_path": "reported first path",
    "background": "background (a recording of its radar with nothing in view)",
}


class Pipeline:
    """A detector: stages with checked ports.

    Parameters
    ----------
    config : DetectorConfig
        Validated detector file.

    Raises
    ------
    ConfigError
        If a stage uses what no earlier stage produces.
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.config = config
        self._check_ports()

    @property
    def name(self) -> str:
        """Name in tables and reports."""
        return self.config.name

    def __repr__(self) -> str:
        return f"Pipeline({self.name}: {' -> '.join(step.label for step in self.config.steps)})"

    def _repr_html_(self) -> str:
        from uwbbench.show.notebook.detector import detector

        return detector(self)

    def _check_ports(self) -> None:
        available = {"frames"}
        makers: dict[str, str] = {}
        given: dict[str, set[str]] = {}
        for step in self.config.steps:
            for port in registry.load_plugin("stages", step.use).produces:
                makers.setdefault(port, step.label)
        for step in self.config.steps:
            stage = registry.load_plugin("stages", step.use)
            given[step.label] = available
            # What a step takes away is there for the one that takes its place.
            there = available | given[step.unless] if step.unless else available
            for port in sorted(stage.consumes - there):
                if port in makers:
                    hint = f"step '{makers[port]}' makes it, but stands later, or its result is gone by then"
                else:
                    hint = (
                        f"no step makes it; put one of these before it: {', '.join(_makers_of(port)) or 'none known'}"
                    )
                place = f"{step.place}: " if step.place else ""
                raise ConfigError(f"{place}detector '{self.name}': step '{step.label}' needs '{port}': {hint}")
            available = (available - stage.removes) | stage.produces
        if "detections" not in available:
            raise ConfigError(f"detector '{self.name}': no step produces detections")

    def open(self, capture: CaptureHeader, *, audit: bool = False, fused: bool = True, threads: int = 1) -> Stream:
        """Start a stream on a receiver.

        Parameters
        ----------
        capture : Capture or CaptureHeader
            Gives the radar; its samples are not touched. A header has no background.
        audit : bool
            Keep what the filters drop, for ``stream.candidates``.
        fused : bool
            Let kernels take over the runs of stages that they know. They find the same; an audit goes without.
        threads : int
            Threads that a kernel may share a long block among.

        Raises
        ------
        ConfigError
            If the capture lacks what a stage needs and the stage is not optional, or the detector has a mapper.
        """
        if self.config.mapper is not None:
            raise ConfigError(
                f"detector '{self.name}' answers for a run with poses and a map, not for single captures; "
                "'uwbbench run' with the scorings pose and map runs it, and uwbbench.load_mapper in Python"
            )
        steps, notes = self._opened(capture)
        if fused and not audit:
            steps = _fused(steps, notes, threads)
        return Stream(steps, notes, audit=audit)

    def _opened(self, capture: CaptureHeader, until: str | None = None) -> tuple[list[Opened], list[str]]:
        """The stages, up to the step ``until``, opened on the receiver, and what a reader of the results must know."""
        radar, background = capture.radar, background_of(capture)
        counted_from_transmission = radar.first_tap_delay_s is not None
        has = {
            name
            for name, there in (
                ("sts", radar.has_sts),
                ("truth", capture.truth is not None),
                ("first_path", radar.has_first_path or counted_from_transmission),
                ("background", background is not None),
            )
            if there
        }
        available = {"frames"}
        chosen: list[Chosen] = []
        notes: list[str] = []
        missing: dict[str, str] = {}  # port that a step left out would have made: what the capture lacks for it
        left_out: dict[str, list[str]] = {}
        for step in self._steps(until):
            cls = registry.load_plugin("stages", step.use)
            params, fallen = step.params_for(radar.channel)
            if step.unless and step.unless in {one.label for one in chosen}:
                notes.append(f"left out, as '{step.unless}' is in use: {step.label}")
                continue
            if step.implied_by:
                notes.append(f"{step.label}: put before '{step.implied_by}', which needs it, with its defaults")
            given = f"channel {radar.channel}" if radar.channel else "a capture without channel"
            notes += [f"{step.label}: no {name} for {given}, used {params[name]}" for name in fallen]
            checked = cls.params_type().model_validate(params)
            lacks = [_NEEDS.get(need, need) for need in sorted(cls.needs_with(checked) - has)]
            lacks += [missing.get(port, port) for port in sorted(cls.consumes - available)]
            lacks = list(dict.fromkeys(lacks))
            if lacks and step.optional:
                reason = ", no ".join(lacks)
                left_out.setdefault(reason, []).append(step.label)
                missing |= dict.fromkeys(cls.produces, reason)
                continue
            if lacks:
                where = f"detector '{self.name}', step '{step.label}'"
                raise ConfigError(f"{where}: capture '{capture.name}' has no {', no '.join(lacks)}")
            chosen.append(Chosen(step.label, cls, checked, self._load_weights))
            available = (available - cls.removes) | cls.produces
        notes += [f"left out, as the capture has no {reason}: {', '.join(names)}" for reason, names in left_out.items()]
        return opened(chosen, capture, background), notes

    def _steps(self, until: str | None) -> tuple[Step, ...]:
        """The steps before one, by its label; all where None."""
        steps = self.config.steps
        return steps if until is None else steps[: [step.label for step in steps].index(until)]

    def _load_weights(self, stage: Stage[Any], label: str, radar: Radar) -> None:
        if not isinstance(stage.params, LearnedParams):  # asked for every stage: a protocol is slow to tell
            return
        try:
            load_weights(stage, radar, self.steps_before(label, radar.channel))
        except ConfigError as error:
            raise ConfigError(f"detector '{self.name}', step '{label}': {error}") from None

    def steps_before(self, label: str, channel: int | None) -> list[dict[str, Any]]:
        """``use`` and ``params`` of each step before one, with all parameters as they are on a channel.

        Parameters
        ----------
        label : str
            Of the step.
        channel : int or None
        """
        steps = []
        for step in self._steps(label):
            model = registry.load_plugin("stages", step.use).params_type()
            params = model.model_validate(step.params_for(channel)[0]).model_dump(mode="json")
            steps.append({"use": step.use, "params": params})
        return list(portable_weights({"pipeline": steps})["pipeline"])

    def run(
        self,
        capture: Capture,
        *,
        candidates: bool = False,
        handed_out: bool = False,
        fused: bool = True,
        threads: int = 1,
    ) -> Detections:
        """Detect on a whole capture.

        Parameters
        ----------
        capture : Capture
        candidates : bool
            Find the peaks before the filters in the same run; otherwise they are found when somebody asks.
        handed_out : bool
            Find out after which frame each detection is handed out (:mod:`uwbbench.detect.hand_out`), which the scoring
            ``latest`` asks for.
        fused, threads
            As in :meth:`open`.

        Returns
        -------
        Detections
            What the stream yields for the same frames, all blocks and the flush together.
        """
        stream = self.open(capture, audit=candidates, fused=fused, threads=threads)
        sts = "sts" in stream.needs
        blocks = capture.blocks(BATCH_FRAMES, sts=sts) if len(capture) else [capture.frames(sts=sts)]
        detections = Detections.join([*map(stream.step, blocks), stream.flush()])
        if not len(detections):  # an empty table has the columns that a full one would have
            classes = sorted(name for name in stream.ports if name.startswith("class_probability_"))
            usual = [*(name for name in COLUMNS if name in stream.ports), *classes]
            detections = detections.with_columns(**dict.fromkeys(usual, ()))
        detections = detections.annotated(notes=stream.notes)
        if handed_out:
            detections = with_hand_outs(self, capture, detections, threads)
        if candidates:
            return detections.annotated(candidates=stream.candidates(detections), chain=stream.chain)

        @cache
        def audited() -> Detections:
            return self.run(capture, candidates=True)

        return detections.annotated(
            candidates=lambda: _known(audited().candidates),
            chain=(lambda: audited().chain) if stream.fused else stream.chain,
        )

    def signals(self, capture: Capture) -> Iterator[Block]:
        """Blocks as the first stage that makes detections finds them: what it searches, for people to look at.

        Parameters
        ----------
        capture : Capture

        Yields
        ------
        Block
            Frames without clutter, ``first_path``, ``noise_rms`` and ``profile``, as far as the detector makes them.
        """
        steps = self.config.steps
        maker = next(step for step in steps if "detections" in registry.load_plugin("stages", step.use).produces)
        return self.arriving(capture, maker.label)

    def arriving(self, capture: Capture, label: str, *, sts: bool = False) -> Iterator[Block]:
        """Blocks as a step finds them; neither it nor those behind it are opened.

        Parameters
        ----------
        capture : Capture
        label : str
            Of the step.
        sts : bool
            Read STS responses even if no step before it needs them.

        Yields
        ------
        Block
        """
        steps, _ = self._opened(capture, label)
        stream = Stream(steps, [])
        for frames in capture.blocks(BATCH_FRAMES, sts=sts or "sts" in stream.needs):
            yield stream.through(Block(frames.without_invalid()))
        yield from stream.tails()

    @property
    def identity(self) -> str:
        """SHA-256 over the resolved configuration and the sources of its stages."""
        return detector_identity(self.config.to_dict(), self.sources)

    @property
    def sources(self) -> dict[str, str]:
        """SHA-256 of the sources of each stage, and of the kernels that may stand for some, by name."""
        steps = [step for steps in (self.config.steps, *self.config.fronts.values()) for step in steps]
        hashes = {step.use: source_hash(registry.load_plugin("stages", step.use).__module__) for step in steps}
        if self.config.mapper is not None:
            used = self.config.mapper.use
            hashes[f"{MAPPER}{used}"] = source_hash(registry.load_plugin("mappers", used).__module__)
            for other in set(named_within(self.config.mapper.params)) & set(registry.entries("mappers")):
                hashes[inside(used, other)] = source_hash(registry.load_plugin("mappers", other).__module__)
        for name in registry.entries("kernels"):
            with contextlib.suppress(PluginError):  # one that cannot be loaded is not used
                hashes[f"{KERNEL}{name}"] = source_hash(registry.load_plugin("kernels", name).__module__)
        return hashes


def _makers_of(port: str) -> list[str]:
    """Installed stages that produce a port; those that cannot be loaded are passed over."""
    makers = []
    for name in registry.entries("stages"):
        with contextlib.suppress(PluginError):
            if port in registry.load_plugin("stages", name).produces:
                makers.append(name)
    return makers


def _known(candidates: Detections | None) -> Detections:
    return Detections.empty() if candidates is None else candidates


def _fused(steps: list[Opened], notes: list[str], threads: int) -> list[Opened]:
    """Steps with kernels in place of the runs that they know."""
    kernels: list[type[Kernel]] = []
    for name in registry.entries("kernels"):
        try:
            kernels.append(registry.load_plugin("kernels", name))
        except PluginError as error:  # the plain stages do the same
            notes.append(f"not used: {error}")
    fused: list[Opened] = []
    place = 0
    while place < len(steps):
        stages = [step.stage for step in steps[place:]]
        covered, kernel = max(
            ((kind.covers(stages), kind) for kind in kernels), key=lambda pair: pair[0], default=(0, None)
        )
        if kernel is None or covered < 2 or _kept_inside(stages[:covered]) & _wanted(stages[covered:]):
            fused.append(steps[place])
            place += 1
            continue
        label = " + ".join(step.label for step in steps[place : place + covered])
        fused.append(Opened(label, kernel(stages[:covered], threads, notes if place == 0 else ())))
        place += covered
    return fused


def _kept_inside(stages: list[Stage[Any]]) -> frozenset[str]:
    """Ports about frames that these stages make, which a kernel keeps to itself."""
    produced = frozenset[str]().union(*(stage.produces for stage in stages))
    return produced & {"first_path", "noise", "profile"}


def _wanted(stages: list[Stage[Any]]) -> frozenset[str]:
    return frozenset[str]().union(*(stage.wanted for stage in stages))


def load_detector(
    name: str | Path, relative_to: Path | None = None, changes: Mapping[str, Any] | None = None
) -> Pipeline:
    """Load a detector.

    Parameters
    ----------
    name : str or Path
        A shipped or registered name, or a path to a detector YAML.
    relative_to : Path, optional
        Folder that a relative path starts from.
    changes : mapping, optional
        Values to change, by path, for example ``{"pipeline.filter.width.params.minimum": 2}``.

    Raises
    ------
    ConfigError, PluginError
        If the file is missing or wrong.
    """
    return Pipeline(read_detector(str(name), relative_to, changes))


def detector_from_yaml(text: str) -> Pipeline:
    """Detector from YAML text; handy in notebooks and tests."""
    return Pipeline(detector_from_text(text))
