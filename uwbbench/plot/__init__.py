"""Pictures of captures, detectors and runs, for print: see :data:`uwbbench.plot.draw.KINDS`."""
