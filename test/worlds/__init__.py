# Copyright 2026 ride_estimation contributors
"""Independent plants that hide an effect; see README.md. Nothing here but ``adapters`` knows the product."""
