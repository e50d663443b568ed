# Copyright 2026 ride_estimation contributors
"""Errors for the person in the field: what was given, what is allowed, where, what to do."""

from __future__ import annotations

from collections.abc import Iterable


class RideEstimationError(Exception):
    """Base of every error this package raises on purpose; commands turn it into exit code 2."""


class ConfigurationError(RideEstimationError):
    """One or more mistakes in a vehicle file, a scenario or a set of settings, reported all at once.

    Parameters
    ----------
    problems
        One sentence per mistake: field, value given, what is allowed.
    where
        The file or object the problems belong to.
    """

    def __init__(self, problems: str | Iterable[str], where: str = "") -> None:
        self.problems: tuple[str, ...] = (problems,) if isinstance(problems, str) else tuple(problems)
        self.where = where
        head = f"{where}: " if where else ""
        if len(self.problems) == 1:
            text = head + self.problems[0]
        else:
            text = head + f"{len(self.problems)} mistakes\n" + "\n".join(f"  - {p}" for p in self.problems)
        super().__init__(text)


class InputDataError(RideEstimationError):
    """Measured data cannot be used: unreadable, empty, too short, not finite, wrong unit or shape."""
