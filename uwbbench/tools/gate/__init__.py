"""Gates: may a change of a detector go in? Speed against a base, deadlines at the radar's rate, and accuracy.

A gate file names the detector under test (``head``), captures, and limits. Each limit becomes a check with one of four
verdicts, and the verdicts together an exit code that a CI job acts on. Detectors run in worker processes, in this
Python environment or in others; what decides is here.
"""

from uwbbench.tools.gate.check import Check, GateResult, GateVerdict
from uwbbench.tools.gate.config import Gate, read_gate
from uwbbench.tools.gate.execute import run_gate

__all__ = ["Check", "Gate", "GateResult", "GateVerdict", "read_gate", "run_gate"]
