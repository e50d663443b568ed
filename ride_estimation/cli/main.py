# Copyright 2026 ride_estimation contributors
"""Entry point of the ``ride-estimation`` command; every module of this folder that has HELP is a verb."""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import sys
from collections.abc import Sequence
from types import ModuleType

import ride_estimation
import ride_estimation.cli as package
from ride_estimation.errors import RideEstimationError


def verbs() -> dict[str, ModuleType]:
    """Return the verb modules by command name (underscores of the module become dashes)."""
    found: dict[str, ModuleType] = {}
    for info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{package.__name__}.{info.name}")
        if hasattr(module, "HELP"):
            found[info.name.replace("_", "-")] = module
    return dict(sorted(found.items()))


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with one sub-command per verb."""
    parser = argparse.ArgumentParser(prog="ride-estimation", description=ride_estimation.__doc__)
    parser.add_argument("--version", action="version", version=f"ride_estimation {ride_estimation.__version__}")
    commands = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    for name, module in verbs().items():
        sub = commands.add_parser(name, help=module.HELP, description=module.HELP)
        module.add_arguments(sub)
        sub.set_defaults(execute=module.run)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; return 0 on success, 2 on bad input (one message on stderr)."""
    options = build_parser().parse_args(arguments)
    try:
        return int(options.execute(options))
    except RideEstimationError as error:
        print(f"ride-estimation {options.verb}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
