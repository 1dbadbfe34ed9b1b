"""Sphinx: the documentation of lidarium."""

import lidarium

project = "lidarium"
author = "the authors of lidarium"
version = release = lidarium.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = f"lidarium {release}"
exclude_patterns = ["_build"]

nb_execution_timeout = -1  # the first run compiles kernels
nb_execution_raise_on_error = True
nb_merge_streams = True

myst_enable_extensions = ["deflist"]
myst_heading_anchors = 3
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
