"""Settings of the site, for Sphinx: `make docs` builds it into build/site."""

from importlib.metadata import version as installed_version

from pygments.lexer import RegexLexer
from pygments.lexers.prolog import PrologLexer
from pygments.lexers.special import TextLexer

project = "lcorpp"
author = "The lcorpp founders"
version = release = installed_version("lcorpp")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_build"]
nitpicky = False

# Pages are MyST Markdown; a page with a header `file_format: mystnb` is a notebook and is executed.
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

html_theme = "furo"
html_title = "lcorpp"
html_static_path: list[str] = []


def setup(app):
    """Register the languages of the pages' blocks that Pygments does not know."""
    lexers: dict[str, type[RegexLexer]] = {"plog": PrologLexer, "problog": PrologLexer, "pomdp": TextLexer}
    for name, lexer in lexers.items():
        app.add_lexer(name, lexer)
