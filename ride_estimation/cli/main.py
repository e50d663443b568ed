# Copyright 2026 ride_estimation contributors
"""Entry point of the ``ride-estimation`` command.

Every module of :mod:`ride_estimation.cli.arguments` that has HELP is a verb; the module of the same name beside this one does its
work. Only the arguments of the verb that is asked for are imported, the others are known by the HELP line of their source; the
work, with everything numeric, is imported when the arguments are right.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import os
import pkgutil
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

import ride_estimation
import ride_estimation.cli.arguments as package
from ride_estimation.cli.terminal import printable_output
from ride_estimation.errors import RideEstimationError

#: verbs by what one wants to do, in the order of a first day; others follow under "more"
TOPICS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("start here", ("demo", "inspect", "new-vehicle", "plan", "calibrate", "replay", "view", "diagnose")),
    ("several runs", ("project", "compare", "fleet")),
    ("other files and programs", ("map", "import-file", "export-file", "export-model")),
)
EPILOG = """\
A first day, on the recordings that come with the package:
  ride-estimation demo                                                  what it does, against known truth
  ride-estimation plan --vehicle truck_cab                              which parameters these sensors can identify
  ride-estimation replay bags/nominal/bag --vehicle truck_cab --out out/nominal
                                                                        then open out/nominal/report.html
Run 'ride-estimation COMMAND --help' for details; exit code 0 is success, 2 bad input with one message.
"""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence: the usage of a verb with many options would hide it."""

    def error(self, message: str) -> NoReturn:
        """Leave with exit code 2."""
        self.exit(2, f"{self.prog}: {message}; see '{self.prog} --help'\n")


def verb_helps() -> dict[str, str]:
    """Return the one-line help by verb without importing the verbs (underscores of a module become dashes)."""
    found: dict[str, str] = {}
    for info in pkgutil.iter_modules(package.__path__):
        source = Path(str(package.__path__[0])) / f"{info.name}.py"
        _, assigned, rest = source.read_text(encoding="utf-8").partition("\nHELP = ")
        if assigned:
            found[info.name.replace("_", "-")] = _first_value(rest)
    return dict(sorted(found.items()))


def _first_value(source: str) -> str:
    """Return the text a piece of source begins with; to parse whole modules takes longer than many a verb."""
    lines = source.splitlines()
    for count in range(1, len(lines)):
        try:
            return str(ast.literal_eval("\n".join(lines[:count])))
        except SyntaxError:
            continue  # it goes on in the next line
    return str(ast.literal_eval(source))


def arguments_of(verb: str) -> ModuleType:
    """Import and return what a verb takes."""
    return importlib.import_module(f"{package.__name__}.{verb.replace('-', '_')}")


def work_of(verb: str) -> ModuleType:
    """Import and return what a verb does."""
    return importlib.import_module(f"ride_estimation.cli.{verb.replace('-', '_')}")


def build_parser(only: Iterable[str] | None = None) -> argparse.ArgumentParser:
    """Return the parser with one sub-command per verb.

    Parameters
    ----------
    only
        Verbs whose options are wanted; all by default. The others are listed with their help but take no options.
    """
    helps = verb_helps()
    wanted = set(helps if only is None else only)
    parser = _Parser(
        prog="ride-estimation", description=_overview(helps), epilog=EPILOG, usage="%(prog)s [-h] [--version] COMMAND ...",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--version", action="version", version=f"ride_estimation {ride_estimation.__version__}")
    commands = parser.add_subparsers(dest="verb", required=True, metavar="COMMAND", prog=parser.prog, help="one of the above")
    for name, text in helps.items():
        if name not in wanted:
            commands.add_parser(name, description=text)
            continue
        module = arguments_of(name)
        teach = getattr(module, "EXAMPLES", "")
        # shell completion takes only verbs with a help line; the help itself lists them by topic instead
        listed: dict[str, Any] = {"help": text} if only is None else {}
        sub = commands.add_parser(
            name, description=f"{text[0].upper()}{text[1:]}.", epilog=f"examples:\n{teach}" if teach else "",
            formatter_class=argparse.RawDescriptionHelpFormatter, **listed,
        )  # fmt: skip
        module.add_arguments(sub)
    return parser


def _overview(helps: dict[str, str]) -> str:
    named = {verb for _, group in TOPICS for verb in group}
    groups = [*TOPICS, ("more", tuple(verb for verb in helps if verb not in named))]
    lines = [str(ride_estimation.__doc__ or "").strip().splitlines()[0]]
    for title, group in ((t, g) for t, g in groups if set(g) & set(helps)):
        lines += ["", f"{title}:", *(f"  {verb:<16}{helps[verb]}" for verb in group if verb in helps)]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb; return 0 on success, 2 on bad input (one message on stderr)."""
    with printable_output():
        return _main(arguments)


def _main(arguments: Sequence[str] | None) -> int:
    given = list(sys.argv[1:] if arguments is None else arguments)
    helps = verb_helps()
    parser = build_parser([word for word in given if word in helps][:1])
    if "" in given:
        place = given.index("")
        before = f" after {given[place - 1]}" if place else ""
        parser.error(f"an empty argument{before}: a variable of the shell that is not set?")
    options = parser.parse_args(given)
    try:
        status = int(work_of(options.verb).run(options))
        sys.stdout.flush()
        return status
    except RideEstimationError as error:
        print(f"ride-estimation {options.verb}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # the reader of the output has gone (| head): nothing more to say, and nothing to flush at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        # disk full, no permission, disk gone: where reading and writing have no words of their own
        place_of_error = error.filename or "input or output"
        print(f"ride-estimation {options.verb}: {place_of_error}: {error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
