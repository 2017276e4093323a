"""The direct path: its estimators, and frames aligned on it."""
