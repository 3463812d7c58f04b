"""Sphinx, for tools/docs."""

import os
import re

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
with open(os.path.join(ROOT, "CMakeLists.txt"), encoding="utf-8") as stream:
    release = re.search(r"project\(limn VERSION (\S+)", stream.read())[1]
project = "limn"
html_title = f"limn {release}"
extensions = ["myst_nb"]
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["limn.css"]
html_copy_source = False
html_show_copyright = False
exclude_patterns = ["README.md"]
myst_heading_anchors = 3
nb_execution_mode = os.environ["LIMN_EXECUTE"]
nb_execution_timeout = 300  # seconds of a cell; they take 30 at most
nb_execution_raise_on_error = True
nb_execution_show_tb = True
# Pages of the repository begin with the level that suits them there.
suppress_warnings = ["myst.header"]
# Code without a language is shell or samples of output.
highlight_language = "none"
