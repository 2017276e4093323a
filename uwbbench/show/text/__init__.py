"""Tables of a run as text: terminal, Markdown, CSV, LaTeX and JSON.

Nothing is imported here: light commands print numbers without the libraries that a report needs.
"""
