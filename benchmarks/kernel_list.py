# Copyright 2026 ride_estimation contributors
"""Write the list of kernels that the first start compiles ahead: what a made-up drive of the bundled vehicle calls.

    python benchmarks/kernel_list.py            # shows what is missing in the list and what is listed in vain
    python benchmarks/kernel_list.py --write    # after a change of the kernels
"""

from __future__ import annotations

import argparse
from pathlib import Path

from ride_estimation.estimation import kernel_list
from ride_estimation.estimation.common.settings import PipelineSettings
from ride_estimation.estimation.warm_up import warm_up
from ride_estimation.io.vehicle_file import load_vehicle
from ride_estimation.jit import recorded_calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true")
    write = parser.parse_args().write
    with recorded_calls() as calls:
        warm_up(load_vehicle("truck_cab"), PipelineSettings())
    for sign, names in (("+", calls - set(kernel_list.KERNELS)), ("-", set(kernel_list.KERNELS) - calls)):
        for name, arguments in sorted(names):
            print(f"{sign} {name} {arguments}")
    if write:
        place = Path(kernel_list.__file__)
        head = place.read_text(encoding="utf-8").partition("KERNELS: ")[0]
        lines = "".join(f'    ("{name}", "{arguments}"),\n' for name, arguments in sorted(calls))
        place.write_text(f"{head}KERNELS: tuple[tuple[str, str], ...] = (\n{lines})\n", encoding="utf-8")


if __name__ == "__main__":
    main()
