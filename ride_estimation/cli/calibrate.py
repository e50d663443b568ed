# Copyright 2026 ride_estimation contributors
"""``ride-estimation calibrate``: errors of the sensors from a standstill or a drive, written to a vehicle file."""

from __future__ import annotations

import argparse

from ride_estimation.assessment.standstill import calibrate
from ride_estimation.assessment.standstill import summary_lines as standstill_lines
from ride_estimation.cli.parts import read_part
from ride_estimation.errors import InputDataError
from ride_estimation.io.results import output_folder
from ride_estimation.io.vehicle_file import find_vehicle_file, load_vehicle, save_vehicle


def run(options: argparse.Namespace) -> int:
    """Calibrate, print, write."""
    vehicle = load_vehicle(options.vehicle)
    if options.out is not None and options.out.suffix not in (".yaml", ".yml"):
        raise InputDataError(f"{options.out}: a vehicle file is written as .yaml or .yml")
    if options.out is not None and options.out.exists() and options.out.samefile(find_vehicle_file(options.vehicle)):
        raise InputDataError(f"{options.out}: is the vehicle file that is read; its comments would be lost: write another file")
    recording = read_part(options.recording, vehicle, options)
    if options.drive:
        single = [s.name for s in vehicle.sensors.values() if not s.triaxial]
        if single:
            raise InputDataError(
                "calibrate --drive needs triaxial accelerometers; some axes only are measured by "
                f"{', '.join(single)}: calibrate at standstill without --drive"
            )
        # whoever named a wrong file need not wait for the model of the drive
        from ride_estimation.estimation.model.drive_calibration import calibrate_drive, summary_lines

        drive = calibrate_drive(recording, vehicle)
        lines, calibrated = summary_lines(drive), drive.vehicle(vehicle)
        refused = not drive.usable
    else:
        standstill = calibrate(recording, vehicle)
        lines, calibrated = standstill_lines(standstill), standstill.vehicle(vehicle)
        refused = False
    print("\n".join(lines))
    if options.out is not None and refused:
        raise InputDataError(f"{options.out}: not written, the model does not describe this drive well enough")
    if options.out is not None:
        output_folder(options.out.parent)
        try:
            save_vehicle(calibrated, options.out)
        except OSError as error:
            raise InputDataError(f"{options.out}: cannot be written: {error.strerror or error}") from error
        print(f"written: {options.out}")
    return 0
