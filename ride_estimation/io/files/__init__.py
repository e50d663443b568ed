# Copyright 2026 ride_estimation contributors
"""Measurement files of other programs: MDF4, TDMS, RPC III, LabVIEW, CSV, Parquet; one file per format."""
