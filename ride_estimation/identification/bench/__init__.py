# Copyright 2026 ride_estimation contributors
"""Identification of one force element from bench records of displacement and force."""
