"""Tuning: the thresholds of highest F1 on some captures, what they are worth on others, and how much they matter."""

from uwbbench.tools.tune.config import Tuning, read_tuning
from uwbbench.tools.tune.execute import Tuned, TuneOutcome, tune
from uwbbench.tools.tune.publish import new_folder, publish, to_dict
from uwbbench.tools.tune.sheets import sheets

__all__ = ["TuneOutcome", "Tuned", "Tuning", "new_folder", "publish", "read_tuning", "sheets", "to_dict", "tune"]
