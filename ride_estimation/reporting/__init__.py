# Copyright 2026 ride_estimation contributors
"""Text, tables, plots and the HTML report."""
