"""Metrics: pure functions that turn outcomes of scoring into numbers.

One definition of each number: the command line, reports, intervals and comparisons all come here.
"""
