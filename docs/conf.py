"""Settings of the documentation: `make docs` builds it, with warnings as errors."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

import hipuq

project = "hipuq"
author = "The hipuq developers"
copyright = author
version = release = hipuq.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "myst_parser",
    "sphinx_copybutton",
    "sphinx_design",
    "mathml",  # the rest is in docs/extensions
    "tables",
    "study",
]
exclude_patterns = ["extensions", "scripts", "templates"]
templates_path = ["templates"]
smartquotes = False  # quotes in docstrings are those of Python

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
myst_dmath_double_inline = True
math_number_all = False

autosummary_generate = True
autosummary_ignore_module_all = False
autodoc_typehints = "none"  # the docstrings say it, with shapes and units
autodoc_member_order = "bysource"
numpydoc_show_class_members = False  # they are on the page of their class, with their docstrings
numpydoc_xref_param_type = False
default_role = "code"  # `name` in a docstring

html_theme = "pydata_sphinx_theme"
html_title = "hipuq"
html_static_path = ["static"]
html_css_files = ["hipuq.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_align": "left",
    "navigation_with_keys": False,
    "show_prev_next": True,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
    "pygments_dark_style": "github-dark",
}
html_sidebars = {"start": [], "tutorial": [], "comparison": [], "speed": []}

copybutton_prompt_text = "$ "
copybutton_only_copy_prompt_lines = True
copybutton_exclude = ".linenos, .gp, .go"
