# Copyright 2026 ride_estimation contributors
"""The part of a vehicle that a run can test, and how it moves."""
