"""Exact DBSCAN over a grid: kernels and the schedules by which the stage calls them."""
