"""Settings of Sphinx: `make docs` builds the pages into docs/_build/html, without a warning."""

from __future__ import annotations

import re
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

from docutils.nodes import Node, SkipNode, math_block
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator
from sphinx_gallery.scrapers import figure_rst

import signedheat

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "tests"), str(ROOT / "docs")]

from gallery_cards import arrange  # noqa: E402

from public_names import methods  # noqa: E402  of the tests

project = "signedheat"
author = copyright = "The signedheat developers"
version = release = signedheat.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
]
root_doc = "index"
templates_path = ["_templates"]  # pages of the reference, with the examples that use the name
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = [
    "_build",
    "_templates",
    "gallery/**/*.ipynb",
    "gallery/**/*.py",
    "gallery/**/*.zip",
    "gallery/**/*.md5",
]
html_theme = "furo"
html_title = f"signedheat {release}"
html_logo = None
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["pages.css"]

html_math_renderer = "mathml"
myst_enable_extensions = ["amsmath", "dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
autodoc_typehints = "none"  # numpydoc's sections name types in words
autosummary_generate = True
numpydoc_show_class_members = False  # each has an anchor of its own
numpydoc_attributes_as_param_list = True
default_role = "code"  # names in docstrings
suppress_warnings = ["config.cache"]


def scrape(block: object, variables: dict[str, object], settings: dict[str, object]) -> str:
    """The picture that an example has written beside itself, or nothing."""
    source = Path(str(variables["src_file"]))
    picture = source.with_suffix(".png")
    if not picture.exists():
        return ""
    place = Path(next(iter(variables["image_path_iterator"])))  # type: ignore[call-overload]
    shutil.move(picture, place)
    return str(figure_rst([str(place)], str(settings["src_dir"])))


def escape(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Shapes such as ``(*shape)`` in docstrings are no emphasis."""
    lines[:] = [line.replace("(*", "(\\*") for line in lines]


def link_files(app: object, name: str, source: list[str]) -> None:
    """Pages of the repository that are none of the site are files to download, as other files are."""
    source[0] = re.sub(r"\]\((\.\./[^)#\s]+\.md)(#[^)\s]*)?\)", r"](<path:\1>)", source[0])


def write_mathml(translator: HTML5Translator, node: Node) -> None:
    """Write a formula as MathML, which browsers draw without fetching anything."""
    display = "block" if isinstance(node, math_block) else "inline"
    translator.body.append(convert(node.astext(), display=display))
    raise SkipNode


def check_anchors(app: Sphinx, error: Exception | None) -> None:
    """Fail if a public method has no anchor, by which others can link to it."""
    anchors = app.env.get_domain("py").objects
    missing = [name for name, _ in methods() if f"signedheat.{name}" not in anchors]
    if error is None and missing:
        raise ExtensionError(f"the reference has no anchor for {', '.join(missing)}")


def setup(app: Sphinx) -> None:
    """Connect what is done before numpydoc reads docstrings, and after all pages are written."""
    app.connect("autodoc-process-docstring", escape, priority=400)
    app.connect("builder-inited", arrange, priority=900)  # after Sphinx-Gallery
    app.connect("source-read", link_files)
    app.connect("build-finished", check_anchors)
    app.add_html_math_renderer("mathml", (write_mathml, None), (write_mathml, None))


sphinx_gallery_conf = {
    "examples_dirs": ["../examples"],
    "gallery_dirs": ["gallery"],
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("signedheat",),
    "filename_pattern": r"\.py$" if find_spec("torch") else r"/(?!fit_to_distances)\w+\.py$",  # run; others are shown
    "image_scrapers": [scrape],
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "write_computation_times": False,
    "min_reported_time": 1e9,
    "plot_gallery": "True",
    "abort_on_example_error": True,
    "reset_modules": (),
    "first_notebook_cell": None,
}
