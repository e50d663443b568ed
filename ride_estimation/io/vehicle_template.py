# Copyright 2026 ride_estimation contributors
"""A vehicle file to start from: bodies, mounts and sensors by number, every value a placeholder that loads."""

from __future__ import annotations

import dataclasses
import math

from ride_estimation.errors import ConfigurationError

#: most mounts and most sensors on the body that `plan` still judges
MOST_MOUNTS, MOST_SENSORS = 8, 24
#: range of the mass [kg]: the one the loader allows where a body carries sensors
MASS_RANGE = (0.1, 1e5)
#: bounce frequency [Hz] and damping ratio the placeholders give, those of a truck cab on air springs
_BOUNCE_HZ, _DAMPING_RATIO = 2.0, 0.2
#: stiffness and damping along x and y over those along z, usual for mounts with links or bushings
_ALONG = {"x": (7.0, 1.3), "y": (6.0, 1.2), "z": (1.0, 1.0)}
#: density of a cab with its air [kg/m^3]: gives the size that belongs to a mass
_DENSITY = 200.0
_NAMES = {
    2: ("front", "rear"), 3: ("front", "rear_left", "rear_right"), 4: ("front_left", "front_right", "rear_left", "rear_right"),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Template:
    """What a template is made for.

    Attributes
    ----------
    name, body
        Of the vehicle, of the body that is estimated.
    mass
        Of the body [kg].
    mounts, sensors
        Number of mounts, number of three-axis accelerometers on the body.
    base_sensors
        Whether every mount base has an accelerometer.
    cg, inertia
        CG [m] and tensor about it [kg m^2] where they are known from parts; placeholders otherwise.
    """

    name: str = "my_vehicle"
    body: str = "cab"
    mass: float = 1000.0
    mounts: int = 4
    sensors: int = 4
    base_sensors: bool = True
    cg: tuple[float, ...] | None = None
    inertia: tuple[tuple[float, ...], ...] | None = None


def vehicle_template(template: Template) -> str:
    """Return the text of a vehicle file with comments that say what to replace.

    Raises
    ------
    ConfigurationError
        Numbers outside what is allowed, all of them at once.
    """
    from ride_estimation.io.vehicle_file import SCHEMA

    _check(template)
    size = (template.mass / _DENSITY) ** (1.0 / 3.0)
    stiffness = template.mass * (2.0 * math.pi * _BOUNCE_HZ) ** 2 / template.mounts
    damping = 2.0 * _DAMPING_RATIO * stiffness / (2.0 * math.pi * _BOUNCE_HZ)
    inertia = template.mass * size**2 / 6.0
    # on fewer than three mounts a body stands only where it hangs below them
    height = (0.3 if template.mounts < 3 else -0.3) * size
    mounts = dict(zip(_mount_names(template.mounts), _places(template.mounts, 0.5 * size, height)))
    lines = [
        "# Vehicle file. docs/vehicle_file.md lists every key; config/vehicles/every_key.yaml shows every key in use.",
        "# Every number marked 'replace' is a placeholder: size and stiffness follow from the mass and a bounce frequency of "
        f"{_BOUNCE_HZ:g} Hz.",
        "# Axes: x forward, y left, z up, origin anywhere. A quantity is a number or {value, std | relative_std, range, source}.",
        f"schema: {SCHEMA}",
        f"name: {template.name}",
        "bodies:",
        f"  {template.body}:",
        f"    mass_kg: {{value: {template.mass:g}, relative_std: 0.02, source: replace by how it was weighed}}",
        *_distribution(template, inertia),
        "mounts:",
        "  # stiffness and damping are priors: relative_std says how far the truth may be; elements.md lists other kinds",
    ]
    for name, place in mounts.items():
        lines += [f"  {name}:", f"    position_m: {_vector(place)}     # replace", f"    body: {template.body}"]
        lines += ["    base: chassis", "    axes:"]
        for axis, (stiff, damped) in _ALONG.items():
            lines.append(
                f"      {axis}: {{kind: kelvin_voigt, stiffness_n_per_m: {{value: {stiff * stiffness:.4g}, relative_std: 0.3}}, "
                f"damping_n_s_per_m: {{value: {damped * damping:.4g}, relative_std: 0.5}}}}"
            )
    if template.sensors or template.base_sensors:
        lines.append("sensors:")
    if template.sensors:
        lines.append("  # three-axis accelerometers on the body; three that are not on one line determine the whole motion")
    # named by their corner where there is one: a channel map is proposed from such words
    corners = _NAMES.get(template.sensors, tuple(str(i) for i in range(1, template.sensors + 1)))
    for corner, place in zip(corners, _sensor_places(template.sensors, 0.4 * size), strict=True):
        lines.append(_sensor(f"{template.body}_{corner}", f"/{template.body}/{corner}/accel", template.body, place))
    if template.base_sensors:
        lines.append("  # one at the base of every mount: without them mounts and forces cannot be identified")
        for name, place in mounts.items():
            lines.append(_sensor(f"chassis_{name}", f"/chassis/{name}/accel", f"chassis, mount: {name}", place))
    lines += [
        "force_references:",
        "  # what fixes the absolute scale of forces; remove it where the mass was not measured",
        f"  - {{kind: known_mass, body: {template.body}}}",
    ]
    return "\n".join(lines) + "\n"


def _distribution(template: Template, guess: float) -> list[str]:
    """Return the lines of CG and inertia: those of the parts, or placeholders."""
    if template.cg is None or template.inertia is None:
        equal = f"ixx: {guess:.4g}, iyy: {guess:.4g}, izz: {guess:.4g}"
        return [
            "    cg_m: {value: [0.0, 0.0, 0.0], std: [0.05, 0.03, 0.05]}     # replace",
            f"    inertia_kg_m2: {{{equal}, relative_std: 0.2}}     # replace; about the CG",
        ]
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    listed = ", ".join(f"i{'xyz'[i]}{'xyz'[j]}: {template.inertia[i][j] + 0.0:.6g}" for i, j in places)
    centre = ", ".join(f"{v + 0.0:.5g}" for v in template.cg)
    return [
        f"    cg_m: {{value: [{centre}], std: [0.05, 0.03, 0.05]}}     # from the parts; replace the standard deviation",
        f"    inertia_kg_m2: {{{listed}, relative_std: 0.1}}     # from the parts; about the CG",
    ]


def _check(template: Template) -> None:
    problems = []
    for key, name in (("name", template.name), ("body", template.body)):
        if not name.isidentifier() or not name.isascii():
            problems.append(f"{key} {name!r}: a word of letters, digits and underscores is needed that begins with a letter")
    if template.body == "chassis":
        problems.append("body 'chassis': is the base of the mounts here; the body needs another name")
    if not MASS_RANGE[0] <= template.mass <= MASS_RANGE[1]:
        problems.append(f"mass {template.mass:g} kg; allowed: {MASS_RANGE[0]:g} to {MASS_RANGE[1]:g} kg")
    if not 1 <= template.mounts <= MOST_MOUNTS:
        problems.append(f"{template.mounts} mounts; allowed: 1 to {MOST_MOUNTS}")
    if not 0 <= template.sensors <= MOST_SENSORS:
        problems.append(f"{template.sensors} sensors; allowed: 0 to {MOST_SENSORS}")
    if problems:
        raise ConfigurationError(problems)


def _mount_names(count: int) -> tuple[str, ...]:
    return _NAMES.get(count, tuple(f"mount_{i}" for i in range(1, count + 1)))


def _places(count: int, reach: float, height: float) -> list[tuple[float, float, float]]:
    """Return places in the order of the names: the corners of a rectangle, a triangle, a line, or a circle."""
    corners = {
        1: [(0.0, 0.0)], 2: [(1.0, 0.0), (-1.0, 0.0)], 3: [(1.0, 0.0), (-1.0, 1.0), (-1.0, -1.0)],
        4: [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)],
    }  # fmt: skip
    angles = [2.0 * math.pi * (i + 0.5) / count for i in range(count)]
    flat = corners.get(count, [(math.cos(a), math.sin(a)) for a in angles])
    return [(reach * x, reach * y, height) for x, y in flat]


def _sensor_places(count: int, reach: float) -> list[tuple[float, float, float]]:
    """Return places on the body; every fourth is raised, so that they do not lie in one plane."""
    flat = _places(count, reach, 0.0) if count else []
    return [(x, y, reach if i % 4 == 3 else -0.5 * reach) for i, (x, y, _) in enumerate(flat)]


def _sensor(name: str, topic: str, body: str, place: tuple[float, float, float]) -> str:
    return f"  {name}: {{kind: accelerometer, topic: {topic}, body: {body}, position_m: {_vector(place)}, noise_m_per_s2: 0.02}}"


def _vector(place: tuple[float, float, float]) -> str:
    return "[" + ", ".join(f"{v + 0.0:.3f}" for v in place) + "]"
