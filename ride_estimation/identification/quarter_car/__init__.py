# Copyright 2026 ride_estimation contributors
"""The six nested quarter-car models of document 002, fitted with bounds, multi-start and a plausibility gate."""
