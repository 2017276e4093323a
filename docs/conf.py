"""How the documentation is built: ``make docs``, offline, every warning an error."""

import sys
from pathlib import Path

import uwbbench

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "uwbbench"
author = "the uwbbench contributors"
release = version = uwbbench.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated"]
exclude_patterns = ["_build", "pictures", "leaderboard"]

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # the docstrings give types with shapes and units
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": False}
napoleon_google_docstring = False
napoleon_custom_sections = [("Class attributes", "params_style"), ("Conventions", "notes_style")]
napoleon_use_rtype = False

html_theme = "furo"  # one column on a phone, light and dark, nothing loaded from elsewhere
html_title = "uwbbench"
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_theme_options = {"footer_icons": []}
