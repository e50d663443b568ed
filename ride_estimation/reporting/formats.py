# Copyright 2026 ride_estimation contributors
"""A report in the formats that were asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ride_estimation.reporting.page import Page


def clear_pages(folder: Path) -> None:
    """Remove the report of an earlier call from a folder, so that no old page stands beside new results."""
    for name in ("report.html", "report.pdf"):
        (folder / name).unlink(missing_ok=True)
    pictures = folder / "pictures"
    for picture in pictures.glob("[0-9][0-9]_*.png"):
        picture.unlink()
    if pictures.is_dir() and not any(pictures.iterdir()):
        pictures.rmdir()


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
        from ride_estimation.reporting.pdf import write_pdf  # a third of a second, and few want it

        write_pdf(page, folder / "report.pdf")
        written.append("report.pdf")
    if "png" in formats:
        files = page.write_png(folder / "pictures")
        written.append(f"pictures ({len(files)} files)")
    return written
