# Copyright 2026 ride_estimation contributors
"""Settings, effects, spectra and words that every part of the diagnosis uses."""
