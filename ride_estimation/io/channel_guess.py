# Copyright 2026 ride_estimation contributors
"""Which channel of a logger file may belong to which component of which sensor, by name, unit and gravity.

A name is taken apart into words (``AccFL_X`` -> acc, front, left, x). A channel fits a component when its unit is of the same
kind, its axis is the same and no word says another place. Of those the one that shares most words with the sensor is proposed,
and only if no other shares as many: a guess is checked by a person, a wrong one is worse than none.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ride_estimation.io.files.channel_map import components
from ride_estimation.io.files.channels import FileChannel, unit_factor
from ride_estimation.sensors.sensor import Sensor

#: what people write -> words
_SHORT = {
    "fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right", "lf": "front left", "rf": "front right",
    "lr": "rear left", "vl": "front left", "vr": "front right", "hl": "rear left", "hr": "rear right", "lh": "left",
    "rh": "right", "back": "rear", "vorn": "front", "vorne": "front", "hinten": "rear", "links": "left", "rechts": "right",
    "cabin": "cab", "kabine": "cab", "fahrerhaus": "cab", "frame": "chassis", "base": "chassis", "rahmen": "chassis",
    "longitudinal": "x", "lateral": "y", "vertical": "z", "laengs": "x", "quer": "y", "hoch": "z", "vert": "z", "long": "x",
    "lat": "y", "velocity": "speed", "geschwindigkeit": "speed",
}  # fmt: skip
_AXES = ("x", "y", "z")
#: words of which one excludes the others
_PLACES = (("front", "rear"), ("left", "right"), ("cab", "chassis", "seat"))
#: parts of a name: capitals before a word, words, capitals, digits
_PARTS = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
#: share of gravity from which on a mean says which way an axis points
_GRAVITY_SEEN = 0.7


@dataclasses.dataclass(frozen=True)
class Guess:
    """A channel that is proposed for a component.

    Attributes
    ----------
    channel
        Of the file.
    unit
        To be said in the map, empty where the file states one.
    factor
        -1 where gravity has the other sign than the vehicle file lets expect.
    why
        What the proposal rests on, in words.
    by_gravity
        Whether the unit follows from gravity in the mean.
    """

    channel: str
    unit: str
    factor: float
    why: str
    by_gravity: bool = False


def words_of(name: str) -> frozenset[str]:
    """Return the words of a name, short forms written out.

    Examples
    --------
    >>> sorted(words_of("AccFL_X"))
    ['acc', 'front', 'left', 'x']
    """
    found: set[str] = set()
    for part in _PARTS.findall(name.replace("/", " ")):
        word = part.lower()
        if word not in _SHORT and len(word) == 3 and word[:2] in _SHORT and word[2] in _AXES:
            found.update((*_SHORT[word[:2]].split(), word[2]))  # FLZ
        elif word not in _SHORT and len(word) == 2 and word[0] == "a" and word[1] in _AXES:
            found.update(("acc", word[1]))  # ax
        else:
            found.update(_SHORT.get(word, word).split())
    return frozenset(found)


def best_match(name: str, choices: Mapping[str, Iterable[str]]) -> str:
    """Return the choice whose words a name shares most of, empty where none or several do.

    Parameters
    ----------
    name
        Of a channel or a topic.
    choices
        Name -> words.
    """
    own = words_of(name)
    scores = sorted(((_shared(own, frozenset(words)), choice) for choice, words in choices.items()), reverse=True)
    if not scores or scores[0][0] == 0 or (len(scores) > 1 and scores[1][0] == scores[0][0]):
        return ""
    return scores[0][1]


def _shared(own: frozenset[str], words: frozenset[str]) -> int:
    """Return how many words two names share, none where they speak of two places; a body alone is no place."""
    for group in _PLACES:
        here, there = own & set(group), words & set(group)
        if here and there and not here & there:
            return 0
    common = own & words
    return len(common) if common - set(_PLACES[2]) - set(_AXES) else 0


def sensor_words(sensor: Sensor) -> frozenset[str]:
    """Return the words by which a sensor may be called."""
    return words_of(sensor.name) | words_of(sensor.body) | ({sensor.axis} if sensor.axis else set())


def guess_channels(channels: Sequence[FileChannel], sensors: Mapping[str, Sensor], gravity: float) -> dict[str, Guess]:
    """Return the channel proposed for every component that has one.

    Parameters
    ----------
    channels
        Of the file.
    sensors
        Of the vehicle.
    gravity
        [m/s^2].
    """
    found: dict[str, Guess] = {}
    once = {c.name: c for c in channels if sum(other.name == c.name for other in channels) == 1}
    for sensor in sensors.values():
        own: dict[str, Guess] = {}
        for i, (name, unit) in zip(np.flatnonzero(sensor.measured).tolist(), components(sensor)):
            axis = name.rpartition(".")[2].rpartition("_")[2] if "." in name else sensor.axis
            fitting = {c.name: words_of(c.name) - set(_AXES) for c in once.values() if _fits(c, sensor, unit, axis)}
            exact = [c for c in fitting if c == name]
            chosen = exact[0] if exact else _closest(sensor_words(sensor) - set(_AXES), fitting)
            if chosen:
                up = float((sensor.rotation.T @ (0.0, 0.0, gravity))[i]) if unit == "m/s^2" and sensor.coupling == "dc" else 0.0
                own[name] = _guess(once[chosen], unit, up, gravity)
        # one sensor speaks in one unit: the axis along gravity says it for the others
        level = next((guess for guess in own.values() if guess.by_gravity), None)
        for name, guess in own.items():
            same = level is not None and guess.unit == "m/s^2" and not guess.by_gravity
            found[name] = dataclasses.replace(guess, unit=level.unit, why=level.why) if same and level is not None else guess
    used = [guess.channel for guess in found.values()]
    return {name: guess for name, guess in found.items() if used.count(guess.channel) == 1}


def _closest(words: frozenset[str], fitting: Mapping[str, frozenset[str]]) -> str:
    """Return the channel that shares most words with a sensor; the only one there is needs to share none."""
    scores = sorted(((_shared(own, words), -len(own), name) for name, own in fitting.items()), reverse=True)
    if len(scores) == 1 and not any(fitting[scores[0][2]] & set(group) for group in _PLACES):
        return scores[0][2]
    if not scores or scores[0][0] == 0 or (len(scores) > 1 and scores[1][:2] == scores[0][:2]):
        return ""
    return scores[0][2]


def _fits(channel: FileChannel, sensor: Sensor, unit: str, axis: str) -> bool:
    """Return whether unit and axis of a channel are those of a component."""
    known = unit_factor(channel.unit) if channel.unit else None
    own = words_of(channel.name)
    kinds = {"m/s^2": {"acc", "accel", "acceleration", "g", "a"}, "rad/s": {"gyro", "rate", "omega", "gyr", "angular"}}
    kinds |= {"m": {"disp", "displacement", "travel", "pot", "stroke", "lvdt", "deflection"}, "N": {"force", "load", "f"}}
    if known is not None:
        if known[0] != unit:
            return False
    elif unit in kinds and not own & kinds[unit]:
        return False  # neither unit nor name says what it is
    axes = own & set(_AXES)
    several = len(components(sensor)) > 1
    return axes == {axis} if axis and several else not axes or axes == {axis}


def _guess(channel: FileChannel, unit: str, up: float, gravity: float) -> Guess:
    """Return the proposal with the unit and the sign that gravity asks for."""
    mean = float(np.nanmean(channel.values)) if np.isfinite(channel.values).any() else 0.0
    known = unit_factor(channel.unit) if channel.unit else None
    said, why, by_gravity = "", f"name and unit [{channel.unit}]", False
    if known is None:
        said, why = "mm" if unit == "m" else unit, "name; the file states no unit: check"
        if unit == "m/s^2" and abs(up) > _GRAVITY_SEEN * gravity:
            by_gravity = True
            level = {"g": 1.0, "m/s^2": gravity, "mg": 1e3}
            said = min(level, key=lambda u: abs(np.log(max(abs(mean), 1e-9) / level[u])))
            why = f"name; no unit in the file, a mean of {mean:.3g} is gravity in {said}"
    scale = known[1] if known is not None else (unit_factor(said) or ("", 1.0))[1]
    turned = abs(up) > _GRAVITY_SEEN * gravity and scale * mean * np.sign(up) < -_GRAVITY_SEEN * gravity
    sign = "; gravity has the other sign: factor -1" if turned else ""
    return Guess(channel.name, said, -1.0 if turned else 1.0, why + sign, by_gravity)
