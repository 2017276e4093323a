"""A detector at work: stages chained into a pipeline, and its stream."""
