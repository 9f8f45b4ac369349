"""How the documentation is built: `make docs`; warnings are errors."""

import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

project = "padwatch"
author = "the makers of padwatch"
release = version = installed("padwatch")
language = "en"

extensions = ["myst_parser", "padwatch_reference"]
exclude_patterns = ["_ext"]
nitpicky = True

# Equations are plain text, so that they read the same on a forge, on paper and without a network.
myst_heading_anchors = 3
suppress_warnings = [
    "toc.not_included",  # a new page may be outside the table of contents
]

html_theme = "furo"
html_title = "padwatch"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
