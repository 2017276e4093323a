"""Running an experiment: the plan of units, the parallel accuracy pass, the serial latency pass, and scoring again."""

from uwbbench.run.execute import Interrupted, Progress, run_experiment
from uwbbench.run.rescore import rescore

__all__ = ["Interrupted", "Progress", "rescore", "run_experiment"]
