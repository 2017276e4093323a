"""Charts of pages as Vega-Lite specifications; why print has others is said in :mod:`uwbbench.show.figures`."""
