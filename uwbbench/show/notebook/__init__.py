"""What captures, truth, detections, scores and detectors look like in a notebook.

Each object has a ``_repr_html_`` that finds its function here by name when a notebook asks; a plain ``repr`` stays one
line. Every name is escaped, nothing is loaded from anywhere, and no function changes what it shows.
"""

from uwbbench.show.notebook.capture import capture, truth
from uwbbench.show.notebook.detections import detections
from uwbbench.show.notebook.detector import detector
from uwbbench.show.notebook.scores import scores

__all__ = ["capture", "detections", "detector", "scores", "truth"]
