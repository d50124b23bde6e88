"""Settings of the site, for Sphinx: `make docs` builds it into build/site."""

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

from api_reference import find_source
from repository import URL

project = "lcorpp"
author = "The lcorpp founders"
copyright = "2026, the lcorpp founders, MIT licence"
version = release = installed_version("lcorpp")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.linkcode",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "accessible",
    "repository",
    "api_reference",
    "command_reference",
    "lexers",
    "mathml",
    "play_page",
]
exclude_patterns = ["_build", "_extensions"]
linkcode_resolve = find_source

# Pages are MyST Markdown; a page with a header `file_format: mystnb` is a notebook and is executed.
myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_cache_path = str(Path(__file__).parents[1] / "build" / "notebooks")
nb_execution_raise_on_error = True
nb_execution_timeout = 300
os.environ["PATH"] = os.pathsep.join(
    [str(Path(sys.executable).parent), os.environ["PATH"]]
)  # `lcorpp` in notebooks
nb_ipywidgets_js: dict[str, dict[str, str]] = {}  # by default from a server
smartquotes = False  # `--option` keeps its hyphens

# Docstrings: single backticks are names, which become links if the site has them.
default_role = "py:obj"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: f"lcorpp.values.{name}"
    for name in ("Array", "Belief", "Flags", "Indices", "Label", "Kind", "SharedValue")
}
napoleon_numpy_docstring = False
napoleon_use_param = False
napoleon_use_rtype = False
napoleon_custom_sections = [("Fields", "params_style")]
python_maximum_signature_line_length = 88
python_display_short_literal_types = True

html_theme = "furo"
html_title = "lcorpp"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_math_renderer = "mathml"
html_copy_source = False
html_theme_options = {
    "source_repository": URL,
    "source_branch": "main",
    "source_directory": "docs/",
    "footer_icons": [{"name": "GitHub", "url": URL, "html": "", "class": ""}],
}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
