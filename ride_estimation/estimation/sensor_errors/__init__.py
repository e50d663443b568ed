# Copyright 2026 ride_estimation contributors
"""Errors of accelerometers that are installed as usual: tolerances, score tests, what they leave uncertain."""
