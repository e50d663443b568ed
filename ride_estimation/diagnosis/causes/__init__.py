# Copyright 2026 ride_estimation contributors
"""Candidate causes of a misfit, one file each."""
