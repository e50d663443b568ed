# Copyright 2026 ride_estimation contributors
"""Series, alignment of sensor stamps, filters, integration, spectra."""
