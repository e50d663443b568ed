# Copyright 2026 ride_estimation contributors
"""Hostile files: readers as targets, samples to start from, and the mutations that are put on them."""
