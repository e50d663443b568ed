# Copyright 2026 ride_estimation contributors
"""Sphinx settings of the documentation site: ``make docs`` builds it, warnings are errors."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from ride_estimation.cli.main import main, verb_helps  # noqa: E402

project = "ride_estimation"
author = "ride_estimation contributors"
copyright = "2026, ride_estimation contributors"
extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc"]
html_theme = "furo"
html_title = "ride_estimation"
html_show_sphinx = False

# The pages are written for reading in the repository too: links to code stay what they are there.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
exclude_patterns = ["_build", "jupyter_execute"]
# A notebook that fails fails the site; results are kept until the notebook changes.
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 1800
suppress_warnings = ["myst.xref_missing"]

autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

# Every command's --help, from the commands themselves.


class CommandHelp(Directive):
    """Insert a section per command with what its ``--help`` prints."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        os.environ["COLUMNS"] = "100"
        found: list[nodes.Node] = []
        for verb in verb_helps():
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
                main([verb, "--help"])
            section = nodes.section(ids=[f"command-{verb}"])
            section += [nodes.title(text=verb), nodes.literal_block(text=printed.getvalue(), language="text")]
            found.append(section)
        return found


def setup(app: Sphinx) -> None:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
