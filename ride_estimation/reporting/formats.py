# Copyright 2026 ride_estimation contributors
"""A report in the formats that were asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ride_estimation.reporting.page import Page
from ride_estimation.reporting.pdf import write_pdf


def write_page(page: Page, folder: Path, formats: Sequence[str]) -> list[str]:
    """Write a report and return the names of what was written below the folder.

    Parameters
    ----------
    page
        The report.
    folder
        Existing folder.
    formats
        ``html`` (report.html), ``pdf`` (report.pdf), ``png`` (one file per picture below ``pictures``).
    """
    written = []
    if "html" in formats:
        page.write(folder / "report.html")
        written.append("report.html")
    if "pdf" in formats:
        write_pdf(page, folder / "report.pdf")
        written.append("report.pdf")
    if "png" in formats:
        files = page.write_png(folder / "pictures")
        written.append(f"pictures ({len(files)} files)")
    return written
