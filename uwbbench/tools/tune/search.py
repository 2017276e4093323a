"""Searching a space with Optuna, where the parameters are no thresholds of filters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from uwbbench.api.errors import UwbbenchError
from uwbbench.tools.tune.config import Choices, Interval, SearchModel

Objective = Callable[[dict[str, Any]], float]


def require_optuna() -> None:
    """Refuse to begin without Optuna.

    Raises
    ------
    UwbbenchError
        The message says how to install it.
    """
    try:
        import optuna  # noqa: F401
    except ImportError as error:
        raise UwbbenchError("a search needs Optuna; install it with: pip install 'uwbbench[tune]'") from error


def search(model: SearchModel, objective: Objective, start: Mapping[str, Any] | None = None) -> None:
    """Call an objective with proposed values, as many times, or as long, as the model says.

    Parameters
    ----------
    model : SearchModel
    objective : callable
        Merit of the given values by path, such as a detector's F1; the larger the better.
    start : mapping, optional
        Values to try first: those of the file as it is, where the space holds them.

    Raises
    ------
    UwbbenchError
        If Optuna is not installed.
    """
    require_optuna()
    import optuna

    samplers: dict[str, Any] = {
        "tpe": optuna.samplers.TPESampler,
        "random": optuna.samplers.RandomSampler,
    }
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        study = optuna.create_study(direction="maximize", sampler=samplers[model.sampler](seed=model.seed))
        if start:
            study.enqueue_trial(dict(start))
        study.optimize(lambda trial: objective(_proposed(trial, model)), n_trials=model.trials, timeout=model.timeout_s)
    finally:
        optuna.logging.set_verbosity(before)


def _proposed(trial: Any, model: SearchModel) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for path, space in model.space.items():
        if isinstance(space, Choices):
            values[path] = trial.suggest_categorical(path, space.choices)
        elif space.whole:
            step = 1 if space.step is None else int(space.step)
            values[path] = trial.suggest_int(path, int(space.low), int(space.high), step=step, log=space.log)
        else:
            values[path] = trial.suggest_float(path, space.low, space.high, step=space.step, log=space.log)
    return values


def within(space: Interval | Choices, value: Any) -> bool:
    """Whether a space holds a value, so that it can be tried first."""
    if isinstance(space, Choices):
        return value in space.choices
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and space.low <= value <= space.high and space.step is None
