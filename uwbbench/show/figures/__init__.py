"""Pictures of captures, detectors and runs, for print: see :data:`uwbbench.show.figures.draw.KINDS`."""
