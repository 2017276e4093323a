"""Fitting: stages of a search on some draws, several times over, and the residuals of the best on others."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from uwbbench.api.errors import UwbbenchError
from uwbbench.run.folder.identity import canonical
from uwbbench.tools.fit.config import Cell, Fit, StageModel, matches
from uwbbench.tools.fit.evaluate import Found, Residual, cost, residual, run_cell
from uwbbench.tools.fit.files import Files, changed
from uwbbench.tools.tune.config import Choices, Interval, SearchModel
from uwbbench.tools.tune.search import require_optuna, search

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """One set of values that was tried.

    Attributes
    ----------
    seed : int
        Of the sampler.
    stage : int
        From 1; 0 for the values that the search began with.
    values : dict
        By name of parameter.
    cost : float
        On the draws of the fit.
    """

    seed: int
    stage: int
    values: dict[str, Any]
    cost: float


@dataclass(frozen=True)
class FitOutcome:
    """What a fit gave.

    Attributes
    ----------
    fit : Fit
    trials : tuple of Trial
    best : Trial
    fitted : tuple of Residual
        On the draws that the search saw.
    residuals : tuple of Residual
        On those that it did not see; empty until they are taken.
    seconds : float
        Time of the search.
    out_of_time : bool
        Whether the time ended it, not the number of trials.
    """

    fit: Fit
    trials: tuple[Trial, ...]
    best: Trial
    fitted: tuple[Residual, ...]
    residuals: tuple[Residual, ...]
    seconds: float
    out_of_time: bool

    @property
    def missed(self) -> tuple[Residual, ...]:
        """Targets that the fit answers for and that are out of tolerance on unseen draws, the farthest first."""
        out = [one for one in self.residuals if one.target.judged and not one.reached]
        return tuple(sorted(out, key=lambda one: -one.distance))

    @property
    def passed(self) -> bool:
        """Whether all targets are reached on draws that the fit did not see."""
        return not self.missed


def fit(plan: Fit, progress: Progress = lambda _: None) -> FitOutcome:
    """Search the values that bring every cell nearest to its targets.

    Parameters
    ----------
    plan : Fit
    progress : callable
        Receives what is being done, for people.

    Returns
    -------
    FitOutcome
        Without residuals on unseen draws: those are taken from the written files, by :func:`check`.

    Raises
    ------
    UwbbenchError
        If Optuna is not installed, or the time ended before anything was tried.
    CaptureError, ScoringError
        If a scene cannot be simulated or scored.
    """
    require_optuna()
    begun = time.monotonic()
    runs = [_Search(plan, seed, begun, progress) for seed in plan.model.search.seeds]
    for one in runs:
        one.carry_out()
    trials = tuple(trial for one in runs for trial in one.trials)
    if not trials:
        raise UwbbenchError(f"fit '{plan.name}': search.timeout_s ended before a trial did")
    best = min(trials, key=lambda trial: trial.cost)
    evaluated = _Cells(plan)
    found = {name: evaluated.found(cell, best.values) for name, cell in plan.cells.items()}
    fitted = tuple(residual(target, found[target.cell]) for target in plan.targets)
    seconds = time.monotonic() - begun
    return FitOutcome(plan, trials, best, fitted, (), seconds, seconds >= plan.model.search.timeout_s)


def check(plan: Fit, files: Files, progress: Progress = lambda _: None) -> tuple[Residual, ...]:
    """Residuals of calibrated files on the draws that are for checking.

    Parameters
    ----------
    plan : Fit
    files : mapping of str to Path
        The calibrated ones.
    progress : callable
        Receives what is being done, for people.
    """
    draws = plan.model.checking
    found = {}
    for name, cell in plan.cells.items():
        progress(f"checking {name} on {len(draws.seeds) * draws.runs} draws that the fit did not see")
        found[name] = run_cell(files, cell, draws.seeds, draws.runs)
    return tuple(residual(target, found[target.cell]) for target in plan.targets)


@dataclass
class _Cells:
    """Cells on the draws of the fit; what does not change from trial to trial is not simulated again."""

    plan: Fit
    last: dict[str, tuple[str, Found]] = field(default_factory=dict)

    def found(self, cell: Cell, values: Mapping[str, Any]) -> Found:
        """What a cell gives with values of parameters."""
        changes = self.plan.changes(values, cell)
        key = canonical(changes)
        if cell.name not in self.last or self.last[cell.name][0] != key:
            draws = self.plan.model.fitting
            with changed({name: self.plan.files[name] for name in changes}, changes) as files:
                self.last[cell.name] = key, run_cell(files, cell, draws.seeds, draws.runs)
        return self.last[cell.name][1]


class _Search:
    """All stages with one seed of the sampler."""

    def __init__(self, plan: Fit, seed: int, begun: float, progress: Progress) -> None:
        self.plan, self.seed, self.progress = plan, seed, progress
        self.until = begun + plan.model.search.timeout_s
        self.cells = _Cells(plan)
        self.trials: list[Trial] = []
        self.said = ""
        self.best: Trial | None = None

    def carry_out(self) -> None:
        for number, stage in enumerate(self.plan.model.search.stages, 1):
            left = self.until - time.monotonic()
            if left > 0:
                self._carry_out(stage, number, left)

    def _carry_out(self, stage: StageModel, number: int, left_s: float) -> None:
        start = self.plan.start if self.best is None else self.best.values
        space = self._space(stage, start)
        sampler = self.plan.model.search.sampler
        model = SearchModel(space=space, trials=stage.trials, sampler=sampler, seed=self.seed, timeout_s=left_s)
        before = len(self.trials)

        def merit(values: dict[str, Any]) -> float:
            total = self._try({**start, **values}, number)
            done = f"seed {self.seed}, stage {number}, trial {len(self.trials) - before} of {stage.trials}"
            self.progress(f"{done}: {self.said}")
            return -total

        search(model, merit, {name: _inside(space[name], start[name]) for name in space})

    def _space(self, stage: StageModel, start: Mapping[str, Any]) -> dict[str, Interval | Choices]:
        """What each free parameter of a stage may be."""
        space: dict[str, Interval | Choices] = {}
        for name, free in self.plan.model.parameters.items():
            if matches(name, stage.free):
                space[name] = (
                    Choices(choices=free.choices)
                    if isinstance(free, Choices)
                    else _about(free, start[name], stage.span)
                )
        return space

    def _try(self, proposed: dict[str, Any], stage: int) -> float:
        """Cost of a set of values."""
        values = {name: _rounded(value) for name, value in proposed.items()}
        found = {name: self.cells.found(cell, values) for name, cell in self.plan.cells.items()}
        figures = [(target, found[target.cell].value(target)) for target in self.plan.targets]
        total = sum(cost(target, value) for target, value in figures)
        trial = Trial(self.seed, stage, values, total)
        self.trials.append(trial)
        if self.best is None or total < self.best.cost:
            self.best = trial
            worst, value = max(figures, key=lambda pair: cost(*pair))
            self.said = f"best cost {total:.3f}, farthest {worst.name}: {value:.4g} for {worst.value:.4g}"
        return total


def _inside(space: Interval | Choices, value: Any) -> Any:
    """Value that a search begins with, which rounding may have put just outside."""
    return value if isinstance(space, Choices) else min(max(value, space.low), space.high)


def _rounded(value: Any) -> Any:
    """Number with as many digits as a person would write: files hold what was tried."""
    return float(f"{value:.4g}") if isinstance(value, float) else value


def _about(free: Interval, middle: float, span: float) -> Interval:
    """Part of a range about a value, inside the range."""
    low, high = free.low, free.high
    if span < 1 and free.log:
        reach = (high / low) ** (span / 2)
        low, high = max(low, middle / reach), min(high, middle * reach)
    elif span < 1 and not free.whole and free.step is None:
        reach = (high - low) * span / 2
        low, high = max(low, middle - reach), min(high, middle + reach)
    return Interval(low=low, high=high, step=free.step, log=free.log, whole=free.whole)
