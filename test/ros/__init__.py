# Copyright 2026 ride_estimation contributors
