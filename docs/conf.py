"""The documentation site: `python -m sphinx -W --keep-going docs public` builds it; with `-t quick` no example of the gallery runs.

Asked again, the same command builds changed pages alone.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE)]
# one thread: small matrices gain nothing from more
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from numpydoc.xref import DEFAULT_LINKS  # noqa: E402

import rcsa_ident  # noqa: E402

project = "rcsa-ident"
author = "rcsa-ident developers"
project_copyright = f"{author}, MIT licence"
version = release = rcsa_ident.__version__
language = "en"
default_role = "py:obj"  # a name in single backticks is a link where it has a page

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "sphinxcontrib.bibtex",
    "_ext.citations",
    "_ext.command_pages",
    "_ext.outside_links",
    "_ext.rest_pages",
    "_ext.schema_files",
]
exclude_patterns = ["_ext", "_templates", "examples", "formats/examples", "**/README.md"]
templates_path = ["_templates"]

# pages
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # an included part of the README begins at its own level

# equations: MathJax stands beside the pages, nothing is loaded from elsewhere
mathjax_path = "vendor/mathjax/tex-svg.js"

# names of the package
autosummary_generate = True
autosummary_ignore_module_all = False
autodoc_typehints = "none"  # numpydoc's sections say types, shapes and units
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = True  # the front door's names are links where they are types
numpydoc_xref_ignore = "all"
DEFAULT_LINKS.clear()  # to the pages of Python and NumPy, which lie elsewhere
numpydoc_xref_aliases = {name: f"rcsa_ident.{name}" for name in rcsa_ident.__all__}

# sources of methods
bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "keys"
bibtex_reference_style = "label"

# worked examples
sphinx_gallery_conf = {
    "examples_dirs": ["examples"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"^_",
    "download_all_examples": False,
    "within_subsection_order": "ExampleTitleSortKey",
    "reset_modules": ("matplotlib", "_ext.gallery_style.drawn_in_the_gallerys_style"),
    "plot_gallery": not tags.has("quick"),  # noqa: F821  # Sphinx puts it here
    # what is printed, and not what the last line of a block happens to return
    "capture_repr": (),
    "show_memory": False,
    "write_computation_times": False,  # a page that loads its tables' scripts from elsewhere
    "show_signature": False,
    "remove_config_comments": True,
}

# the look
html_theme = "pydata_sphinx_theme"
html_title = f"rcsa-ident {release}"
html_favicon = "../api/web/icon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "rcsa-ident"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "navbar_end": ["theme-switcher"],
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
}
