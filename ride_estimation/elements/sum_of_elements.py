# Copyright 2026 ride_estimation contributors
"""Any elements in parallel."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Self, final

from ride_estimation.elements.base import ForceElement, Parameter
from ride_estimation.elements.composite import CompositeElement
from ride_estimation.errors import ConfigurationError


@final
@dataclasses.dataclass(frozen=True)
class SumOfElements(CompositeElement):
    """Elements in parallel: all see the same deflection, their forces add.

    In files ``{kind: sum, elements: [{kind: ...}, ...]}``. Numbers of the parts have addresses like
    ``elements[0].stiffness`` (:meth:`addressed`, :meth:`with_values`, :meth:`scaled`).
    """

    KIND: ClassVar[str] = "sum"

    elements: tuple[ForceElement, ...]

    def _bound_problems(self) -> Iterator[str]:
        if not self.elements:
            yield "elements: at least one element is needed"
        for i, part in enumerate(self.elements):
            if not isinstance(part, ForceElement):
                yield f"elements[{i}]: {part!r} is not a force element"

    def parts(self) -> tuple[ForceElement, ...]:
        """Return the elements."""
        return self.elements

    def addressed(self) -> dict[str, tuple[Parameter, float]]:
        """Return the numbers of all parts by address ``elements[i].<address in the part>``."""
        return {
            f"elements[{i}].{address}": entry
            for i, part in enumerate(self.elements)
            for address, entry in part.addressed().items()
        }

    def with_values(self, changes: Mapping[str, float]) -> Self:
        """Return a copy with the numbers at some addresses changed.

        Raises
        ------
        ConfigurationError
            Unknown address, or a value out of bounds.
        """
        known = self.addressed()
        unknown = [a for a in changes if a not in known]
        if unknown:
            raise ConfigurationError([f"unknown parameter {a!r}; known: {', '.join(known)}" for a in unknown], where=self.KIND)
        parts = []
        for i, part in enumerate(self.elements):
            prefix = f"elements[{i}]."
            own = {a[len(prefix) :]: value for a, value in changes.items() if a.startswith(prefix)}
            parts.append(part.with_values(own) if own else part)
        return dataclasses.replace(self, elements=tuple(parts))

    def to_mapping(self) -> dict[str, Any]:
        """Return the YAML form with the parts in a list."""
        return {"kind": self.KIND, "elements": [part.to_mapping() for part in self.elements]}

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Self:
        """Build the sum and its parts; all mistakes are reported at once.

        Raises
        ------
        ConfigurationError
            ``elements`` missing or no list of mappings, or the mistakes of the parts.
        """
        # the registry imports this module to find the class, so it can be imported only once it is needed
        from ride_estimation.elements.registry import element_from_mapping

        problems = [f"unknown key {k!r}; allowed: elements" for k in mapping if k not in ("kind", "elements")]
        entries = mapping.get("elements")
        parts: list[ForceElement] = []
        if not isinstance(entries, (list, tuple)) or not entries:
            problems.append(f"elements: {entries!r} is not a list of force elements")
            entries = ()
        for i, entry in enumerate(entries):
            if not isinstance(entry, Mapping):
                problems.append(f"elements[{i}]: {entry!r} is not a force element; a mapping with kind is needed")
                continue
            try:
                parts.append(element_from_mapping(entry))
            except ConfigurationError as error:
                problems.extend(f"elements[{i}].{problem}" for problem in error.problems)
        if problems:
            raise ConfigurationError(problems, where=cls.KIND)
        return cls(elements=tuple(parts))

    @classmethod
    def example(cls) -> SumOfElements:
        """Return a rubber mount with a bump stop."""
        from ride_estimation.elements.bump_stop import BumpStop
        from ride_estimation.elements.modified_berg import ModifiedBerg

        return cls(elements=(ModifiedBerg.example(), BumpStop.example()))
