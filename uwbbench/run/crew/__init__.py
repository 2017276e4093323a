"""Processes that carry out the units of a run, so that no detector can spoil another's results."""

from uwbbench.run.crew.crew import Crew, Ending, Hands, InProcess, Task, crew_of
from uwbbench.run.crew.messages import unpacked
from uwbbench.run.crew.nursery import nursery as prepare
from uwbbench.run.crew.worker import Raised

__all__ = ["Crew", "Ending", "Hands", "InProcess", "Raised", "Task", "crew_of", "prepare", "unpacked"]
