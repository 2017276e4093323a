"""Scenes as a dataset: captures that are simulated when they are opened."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field

from uwbbench.api import Capture, CaptureError, Card, ConfigError, Dataset, Drive, Params, find_config, nearest
from uwbbench_datasets.simulator.engine import Simulation, simulate
from uwbbench_datasets.simulator.robot import RobotModel, read_robot_file
from uwbbench_datasets.simulator.scene import Scene, SceneModel, TermUse, read_scenes


class SimulatedParams(Params):
    """Which scenes, and what to change in them."""

    scenes: list[str] = Field(min_length=1, description="Shipped names, or paths of scene files.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values to change in each scene, by path.")
    seed: int | None = Field(None, ge=0, description="Of all draws; as the scene says if left out.")
    runs: int | None = Field(None, ge=1, le=10_000, description="Runs of each variant; as the scene says if left out.")
    background: bool = Field(
        False, description="Each capture comes with a background: the same run without its objects, noise drawn anew."
    )


class Simulated(Dataset[SimulatedParams]):
    """Simulated scenes (made when opened, no download).

    Captures are named ``scene/variant/run``, with the receiver behind where a scene has several; a scene that varies
    nothing has no variant in its names.
    """

    card: ClassVar[Card] = Card(
        title="Simulated scenes",
        license="BSD-3-Clause",
        citation="Model terms after arXiv 2512.01018 (setting) and ITU-R P.2040-3 (materials).",
        source="built in",
        origin="simulated",
    )

    scene_model: ClassVar = SceneModel  # what scene files and their terms are checked against, for their schema
    term_model: ClassVar = TermUse
    robot_model: ClassVar = RobotModel
    read_robot: ClassVar = staticmethod(read_robot_file)

    @cached_property
    def _runs(self) -> dict[str, tuple[Scene, int]]:
        """Scene and run by ``scene/variant/run``."""
        runs: dict[str, tuple[Scene, int]] = {}
        for name in self.params.scenes:
            for scene in map(self._seeded, read_scenes(self._file(name), self.params.set)):
                for run in range(1, (self.params.runs or scene.model.runs) + 1):
                    if f"{scene.name}/{run}" in runs:
                        raise ConfigError(f"two scenes are named '{scene.name}'; give one of them another name")
                    runs[f"{scene.name}/{run}"] = (scene, run)
        return runs

    def _file(self, name: str) -> Path:
        if name.endswith((".yaml", ".yml")):
            for root in self.roots:
                if (root / name).is_file():
                    return root / name
        return find_config("scenes", name)

    def _seeded(self, scene: Scene) -> Scene:
        """The scene with the dataset's seed, from which each scene and variant draws otherwise."""
        if self.params.seed is None:
            return scene
        return scene.seeded(self.params.seed)

    def runs(self) -> dict[str, tuple[str, ...]]:
        """Captures of each run, one a receiver, by ``scene/variant/run``."""
        return {run: tuple(self._captures(run)) for run in self._runs}

    def open_run(self, name: str, captures: Sequence[str]) -> Drive:
        """Simulate a run once for all of its receivers."""
        made = {capture.name: capture for capture in self.simulate(name).captures}
        return Drive(name, tuple(made[capture] for capture in captures))

    def simulate(self, run: str, *, threads: int = 1) -> Simulation:
        """Simulate one run, with all of its receivers.

        Raises
        ------
        CaptureError
            If there is no such run.
        """
        if run not in self._runs:
            raise CaptureError(f"no simulated run '{run}'.{nearest(run, self._runs)}")
        scene, number = self._runs[run]
        return simulate(scene, number, background=self.params.background, threads=threads)

    def names(self) -> list[str]:
        """One capture for each receiver of each run."""
        return [name for run in self._runs for name in self._captures(run)]

    def _captures(self, run: str) -> dict[str, str]:
        """Receiver by name of capture."""
        receivers = list(self._runs[run][0].model.receivers)
        return {run: receivers[0]} if len(receivers) == 1 else {f"{run}/{name}": name for name in receivers}

    def scene(self, name: str) -> str:
        """Scene with its variant, and with the run where runs draw places anew; receivers are no other scenes."""
        runs = self._runs.items()
        of = ((run, scene) for run, (scene, _) in runs if name == run or name in self._captures(run))
        own = (run if scene.model.draw else scene.name for run, scene in of)
        return next(own, name)

    def open(self, name: str) -> Capture:
        """Simulate the run that a capture belongs to."""
        for run in self._runs:
            if name in self._captures(run):
                return next(one for one in self.simulate(run).captures if one.name == name)
        raise CaptureError(f"no simulated capture '{name}'.{nearest(name, self.names())}")
