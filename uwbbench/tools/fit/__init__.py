"""Fitting: scenes, and the robot in them, whose free parameters are searched until a detector gives known figures."""

from uwbbench.tools.fit.config import Fit, read_fit
from uwbbench.tools.fit.execute import FitOutcome, fit
from uwbbench.tools.fit.publish import to_dict, write_outcome
from uwbbench.tools.fit.sheets import message, sheets

__all__ = ["Fit", "FitOutcome", "fit", "message", "read_fit", "sheets", "to_dict", "write_outcome"]
