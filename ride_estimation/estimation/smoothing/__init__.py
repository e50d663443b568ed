# Copyright 2026 ride_estimation contributors
"""Smoothed deflections and forces of a finished recording."""
