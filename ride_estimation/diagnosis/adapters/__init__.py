# Copyright 2026 ride_estimation contributors
"""Bench records, oscillators and runs with transducers as runs that the diagnosis accepts."""
