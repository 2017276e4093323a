"""Pictures of captures, detectors and runs, for print: see :data:`uwbbench.show.figures.draw.KINDS`.

Pages have charts of their own (:mod:`uwbbench.show.charts`), made of the same numbers: curves, images and ground truth
come from :mod:`uwbbench.results`. There are two renderers because neither does the work of the other. A page needs
charts that answer to the pointer, change with a choice and follow the theme, which matplotlib cannot. A paper needs
what Vega-Lite lacks: sizes in inches and points, one scale for x and y in a map, a colour bar beside an image whose
values stay data, dense points as pixels inside a vector file, panels that share axes, a second axis in metres above one
in nanoseconds, and a caption across the width.
"""
