# Copyright 2026 ride_estimation contributors
"""Force elements as they are exported: the law, what is known of each parameter, and the data it is known from."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ride_estimation.elements.base import ForceElement
from ride_estimation.errors import ConfigurationError
from ride_estimation.frames import COORDINATES
from ride_estimation.units import ABOUT_AN_AXIS
from ride_estimation.vehicles.assembly import Assembly
from ride_estimation.vehicles.data_range import DataRange
from ride_estimation.vehicles.vehicle import Mount, Prior

Array = NDArray[np.float64]

#: keeps generated names within what every compiler distinguishes
_LONGEST_IDENTIFIER = 60


@dataclasses.dataclass(frozen=True)
class Constant:
    """One parameter of a law: value, what is known of it, and what it means."""

    name: str
    value: float
    unit: str
    meaning: str
    std: float | None = None
    lower: float | None = None
    upper: float | None = None
    source: str = ""
    seen: DataRange | None = None
    axis: str = "z"

    def sentence(self) -> str:
        """Return meaning, unit, standard deviation, range and what the data showed in one line."""
        parts = [f"{self.meaning} [{self.unit}]"]
        if self.std is not None:
            parts.append(f"standard deviation {self.std:g}")
        if self.lower is not None and self.upper is not None:
            parts.append(f"range {self.lower:g} to {self.upper:g}")
        if self.seen is not None:
            parts.append(self.seen.sentence(self.axis))
        return "; ".join(parts)


@dataclasses.dataclass(frozen=True)
class ExportedElement:
    """A force element of one axis.

    Attributes
    ----------
    name
        ``front_left.z``, or the name of the file of a lone element.
    axis
        ``x`` to ``yaw``.
    element
        The law.
    constants
        Its parameters, in the order of ``element.addressed()``; names begin with ``prefix``.
    prefix
        Before the address of a parameter in its name.
    seen
        What the data showed, None where that is not known.
    correlation
        Of the parameters, shape (P, P); the identity where nothing is known of it.
    """

    name: str
    axis: str
    element: ForceElement
    constants: tuple[Constant, ...]
    prefix: str
    seen: DataRange | None
    correlation: Array

    @property
    def turned(self) -> bool:
        """Return whether it acts about an axis."""
        return self.axis in COORDINATES[3:]

    @property
    def known(self) -> int:
        """Return how many parameters have a standard deviation."""
        return sum(c.std is not None for c in self.constants)


def exported(
    name: str,
    axis: str,
    element: ForceElement,
    priors: Mapping[str, Prior],
    seen: DataRange | None,
    *,
    prefix: str = "",
    correlation: Array | None = None,
) -> ExportedElement:
    """Return an element with what is known of its parameters.

    Parameters
    ----------
    name, axis, element, seen, prefix
        See :class:`ExportedElement`.
    priors
        Address of a parameter -> what is known of it.
    correlation
        Of the parameters, shape (P, P).
    """
    constants = []
    for address, (declared, value) in element.addressed().items():
        prior = priors.get(address)
        unit = ABOUT_AN_AXIS.get(declared.unit, declared.unit) if axis in COORDINATES[3:] else declared.unit
        bounded = prior is not None and np.isfinite(prior.lower) and np.isfinite(prior.upper)
        constants.append(
            Constant(
                prefix + address, value, unit, declared.meaning,
                std=None if prior is None else prior.std,
                lower=prior.lower if prior is not None and bounded else None,
                upper=prior.upper if prior is not None and bounded else None,
                source="" if prior is None else prior.source,
                seen=seen,
                axis=axis,
            )
        )  # fmt: skip
    matrix = np.eye(len(constants)) if correlation is None else correlation
    return ExportedElement(name, axis, element, tuple(constants), prefix, seen, matrix)


def of_mount(mount: Mount) -> tuple[ExportedElement, ...]:
    """Return the elements of a mount by axis; parameters are named by axis where there are several.

    Raises
    ------
    ConfigurationError
        The mount has no element.
    """
    if not mount.elements:
        raise ConfigurationError(f"{mount.name}: there is no force element to export")
    several = len(mount.elements) > 1
    return tuple(
        exported(
            f"{mount.name}.{axis}", axis, element, _of_axis(mount, axis), mount.seen.get(axis),
            prefix=f"{axis}." if several else "",
        )
        for axis, element in mount.elements.items()
    )  # fmt: skip


def of_assembly(assembly: Assembly) -> tuple[ExportedElement, ...]:
    """Return the elements of a vehicle in the order of the components of its assembly."""
    mounts = assembly.vehicle.mounts
    return tuple(
        exported(
            f"{name}.{axis}", axis, element, _of_axis(mounts[name], axis), mounts[name].seen.get(axis), prefix=f"{name}.{axis}.",
        )
        for (name, axis), element in zip(assembly.components, assembly.elements, strict=True)
    )  # fmt: skip


def _of_axis(mount: Mount, axis: str) -> dict[str, Prior]:
    return {address: prior for (on, address), prior in mount.priors.items() if on == axis}


def identifier(name: str) -> str:
    """Return a name as an identifier of C, Modelica and MATLAB."""
    word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "model"
    return (f"m_{word}" if word[0].isdigit() else word)[:_LONGEST_IDENTIFIER]
