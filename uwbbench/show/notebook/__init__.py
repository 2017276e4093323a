"""What captures, truth, detections, scores and detectors look like in a notebook.

Each object has a ``_repr_html_`` that imports its function here when a notebook asks; a plain ``repr`` stays one line.
Every name is escaped, nothing is loaded from anywhere, and no function changes what it shows.
"""
