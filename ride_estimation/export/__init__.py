# Copyright 2026 ride_estimation contributors
"""Models for other programs: force elements, mounts and vehicles as C source behind the Functional Mock-up Interface (FMI)."""
