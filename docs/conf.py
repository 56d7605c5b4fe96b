"""How ``make docs`` builds these pages: offline, and with warnings as errors."""

import os
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")  # before any example imports MuJoCo

import gallery_sources  # noqa: E402
import public_names  # noqa: E402

import reliability  # noqa: E402
from reliability import documentation_link  # noqa: E402

project = "transition-reliability"
copyright = "the contributors of transition-reliability"
version = release = reliability.__version__
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["inventories", "sg_execution_times.rst", "gallery/sg_execution_times.rst"]
templates_path = ["_templates"]
default_role = "code"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

# Views of estimators in the gallery link to the pages of the same build.
documentation_link.documentation_address = lambda: ".."

# Every public name has a page of its own, listed from the packages' stubs.
public_names.write_pages(HERE / "api")
autosummary_generate = True
autodoc_typehints = "none"  # numpydoc's sections say what is taken
autodoc_member_order = "bysource"
numpydoc_show_class_members = False  # the template for classes shows methods in full
numpydoc_xref_param_type = True
numpydoc_xref_aliases = public_names.aliases() | {
    "ndarray": "numpy.ndarray",
    "ValueError": "ValueError",
    "TypeError": "TypeError",
}
numpydoc_xref_ignore = "all"  # what is not an alias is words

# The inventories lie here: building asks nothing of the network.
intersphinx_mapping = {
    "python": ("https://docs.python.org/3", "inventories/python.inv"),
    "numpy": ("https://numpy.org/doc/stable", "inventories/numpy.inv"),
    "scipy": ("https://docs.scipy.org/doc/scipy", "inventories/scipy.inv"),
    "sklearn": ("https://scikit-learn.org/stable", "inventories/scikit-learn.inv"),
}

sphinx_gallery_conf = {
    "examples_dirs": str(gallery_sources.write(HERE.parent / "build" / "gallery")),
    "gallery_dirs": "gallery",
    # GALLERY names the examples that are run, as a regular expression: by default all.
    "filename_pattern": os.environ.get("GALLERY") or ".",
    "within_subsection_order": "gallery_sources.reading_order",
    "download_all_examples": False,
    "remove_config_comments": True,
    "default_thumb_file": str(HERE / "pictures" / "framework.png"),
}

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_title = project
# Pages without pages below them have nothing to show at the side.
html_sidebars = {page: [] for page in ("index", "install", "tutorial", "concepts")}
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "header_links_before_dropdown": 8,
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_show_sourcelink = False
toc_object_entries_show_parents = "hide"
html_copy_source = False


def link_pages(_app, _what, _name, _object, _options, lines):
    """Turn the pages that docstrings name, such as docs/labels.md, into links."""
    for number, line in enumerate(lines):
        lines[number] = re.sub(r"(?:``)?docs/(\w+)\.md(?:``)?", r":doc:`/\1`", line)


def setup(app):
    """Leave out of classes what other libraries' base classes bring along."""
    app.connect("autodoc-process-docstring", link_pages)
    app.connect("autodoc-skip-member", public_names.skip_foreign)
