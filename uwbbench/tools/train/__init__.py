"""Training: weights of a stage that learns, from some recordings, and what they are worth on others."""

from uwbbench.tools.train.config import Training, read_training
from uwbbench.tools.train.execute import Trained, train
from uwbbench.tools.train.publish import checked_target, publish, sheets, to_dict

__all__ = ["Trained", "Training", "checked_target", "publish", "read_training", "sheets", "to_dict", "train"]
