# Copyright 2026 ride_estimation contributors
"""Online and offline estimation of ride loads, mount parameters and mount forces, with diagnosis of the model."""

__version__ = "0.1.0"
