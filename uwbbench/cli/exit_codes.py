"""What the shell gets from a command that did not go well; 0 is fine."""

CHECK_FAILED = 1
"""A check, verification or comparison failed."""

USAGE_ERROR = 2
"""A wrong option, file or configuration."""

UNITS_FAILED = 3
"""Some units of a run failed, or some detectors of a warm-up."""

INTERRUPTED = 130
