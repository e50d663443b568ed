# Copyright 2026 ride_estimation contributors
"""Emitted Modelica text, read by a small evaluator of this test: its equations give the forces of the elements.

The evaluator knows the part of the language that the laws use. It stands in for a Modelica tool and shares no code with the
package: it reads declarations, equations and the algorithm of the curve from the text and integrates them itself.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ride_estimation.elements.modified_berg import ModifiedBerg
from ride_estimation.elements.registry import kinds
from ride_estimation.elements.terms import initial_states, pack_terms, response
from ride_estimation.errors import ConfigurationError
from ride_estimation.export.elements import exported
from ride_estimation.export.modelica_package import package_text
from ride_estimation.vehicles.data_range import DataRange
from ride_estimation.vehicles.vehicle import Prior

#: laws with a memory that is no differential equation
REFUSED = ("local_linear_network", "return_point_friction")
STEP = 4e-4
TIME = np.arange(1001) * STEP
WORDS = {"if", "then", "else", "elseif"}
FUNCTIONS = {
    "exp": math.exp, "tanh": math.tanh, "sqrt": math.sqrt, "abs": abs, "max": max, "noEvent": lambda value: value, "size": None,
}  # fmt: skip


def tokens(text: str) -> list[str]:
    found = re.findall(r"\d+\.?\d*(?:e[+-]?\d+)?|[A-Za-z_][\w.]*|<=|>=|<>|[-+*/^(),<>\[\]]", text)
    assert "".join(found) == re.sub(r"\s", "", text), f"not of the language: {text}"
    return found


class Expression:
    """An expression of Modelica as text of Python: ``if`` inside, ``^`` above the sign, indices from one."""

    def __init__(self, text: str) -> None:
        self.rest = tokens(text)
        self.python = self.choice()
        assert not self.rest, f"{text}: left over {self.rest}"

    def take(self, *allowed: str) -> str:
        if self.rest and (not allowed or self.rest[0] in allowed):
            return self.rest.pop(0)
        return ""

    def need(self, word: str) -> None:
        assert self.take(word), f"{word} is missing before {self.rest}"

    def choice(self) -> str:
        if not self.take("if"):
            return self.relation()
        condition = self.choice()
        self.need("then")
        value = self.choice()
        if self.rest[0] == "elseif":
            self.rest[0] = "if"
            return f"({value} if {condition} else {self.choice()})"
        self.need("else")
        return f"({value} if {condition} else {self.choice()})"

    def relation(self) -> str:
        left = self.total()
        sign = self.take("<", ">", "<=", ">=")
        return f"({left} {sign} {self.total()})" if sign else left

    def total(self) -> str:
        sign = self.take("-", "+")
        found = f"(-{self.product()})" if sign == "-" else self.product()
        while sign := self.take("+", "-"):
            found = f"({found} {sign} {self.product()})"
        return found

    def product(self) -> str:
        found = self.power()
        while sign := self.take("*", "/"):
            found = f"({found} {sign} {self.power()})"
        return found

    def power(self) -> str:
        base = self.primary()
        return f"({base} ** {self.primary()})" if self.take("^") else base

    def primary(self) -> str:
        if self.take("("):
            inner = self.choice()
            self.need(")")
            return f"({inner})"
        word = self.take()
        assert word and word not in WORDS, f"no value: {word!r} before {self.rest}"
        if self.take("("):
            arguments = [self.choice()]
            while self.take(","):
                arguments.append(self.choice())
            self.need(")")
            return f"{word}({', '.join(arguments)})"
        if self.take("["):
            index = self.choice()
            self.need("]")
            return f"{word}[int({index}) - 1]"
        return word


def block(text: str, kind: str, name: str) -> str:
    found = re.findall(rf"^ *(?:partial )?{kind} {name} .*?^ *end {name};", text, re.S | re.M)
    assert len(found) == 1, (kind, name, len(found))
    return found[0]


def curve_function(text: str) -> Callable[..., float]:
    """Return the function of the package, its algorithm as Python."""
    body = block(text, "function", "curve").split("algorithm")[1].rsplit("end curve", 1)[0]
    lines, depth = ["def curve(u, points, values, slopes):"], 1
    for line in filter(None, (part.strip() for part in body.splitlines())):
        if line in ("end if;", "end while;"):
            depth -= 1
        elif found := re.fullmatch(r"(\w+) := (.*);", line):
            right = "len(points)" if found[2] == "size(points, 1)" else Expression(found[2]).python
            lines.append("    " * depth + f"{found[1]} = {right}")
        elif found := re.fullmatch(r"(if|elseif) (.*) then", line):
            depth -= found[1] == "elseif"
            lines.append("    " * depth + f"{'elif' if found[1] == 'elseif' else 'if'} {Expression(found[2]).python}:")
            depth += 1
        elif found := re.fullmatch(r"while (.*) loop", line):
            lines.append("    " * depth + f"while {Expression(found[1]).python}:")
            depth += 1
        else:
            assert line == "else", line
            lines.append("    " * (depth - 1) + "else:")
    assert depth == 1
    space: dict[str, Any] = {}
    exec("\n".join([*lines, "    return y"]), space)
    return space["curve"]


class Model:
    """A law of the package with numbers for its parameters."""

    def __init__(self, text: str, name: str, arguments: dict[str, Any]) -> None:
        head, equations = block(text, "model", name).split("equation\n")
        declared = set(re.findall(r"parameter Real (\w+)", head))
        assert declared == set(arguments), (name, declared)
        self.states = re.findall(r"Real (\w+)\(start = 0, fixed = true\)", head)
        unknowns = set(re.findall(r"^ *Real (\w+)", head, re.M)) | {"force"}
        # an event happens where its condition becomes true; both kinds set one value
        events = [
            *((c, s, v) for c, s, v in re.findall(r"when (.*) then\s+reinit\((\w+), (\d+)\);", equations)),
            *((c, s, v) for c, s, v in re.findall(r"when (.*) then\s+(\w+) = (.*);", equations)),
        ]
        discrete = re.findall(r"discrete Real (\w+)\(start = (\d+), fixed = true\)", head)
        self.states = [s for s in self.states if s not in dict(discrete)]
        plain = re.sub(r"when .*?end when;", "", equations.rsplit("end " + name, 1)[0], flags=re.S)
        lines, given = [], {"x", "v", *self.states, *dict(discrete), *declared, "curve", *FUNCTIONS}
        unknowns -= {s for _, s, _ in events if s in dict(discrete)}
        for left, right in re.findall(r"([\w()]+) = (.*?);", plain, re.S):
            used = {t for t in tokens(right) if re.match(r"[A-Za-z_]", t)} - WORDS
            assert used <= given, f"{name}: {used - given} unknown in {left} = {right}"
            state = re.fullmatch(r"der\((\w+)\)", left)
            lines.append(f"{'d_' + state[1] if state else left} = {Expression(right).python}")
            given.add("force" if left == "force" else left)
            unknowns -= {state[1] if state else left}
        assert not unknowns, f"{name}: no equation for {unknowns}"
        self._space = {**FUNCTIONS, **arguments, "curve": curve_function(text)}
        self._code = compile("\n".join(lines), name, "exec")
        self._events = [
            (compile(Expression(c).python, name, "eval"), s, compile(Expression(v).python, name, "eval")) for c, s, v in events
        ]
        self._held = [False] * len(events)
        self.values = dict.fromkeys(self.states, 0.0) | {s: float(v) for s, v in discrete}

    def evaluated(self, x: float, v: float, values: dict[str, float]) -> dict[str, Any]:
        space = {**self._space, "x": x, "v": v, **values}
        exec(self._code, space)
        return space

    def slopes(self, x: float, v: float, values: dict[str, float]) -> dict[str, float]:
        space = self.evaluated(x, v, values)
        return {s: space[f"d_{s}"] for s in self.states}

    def _happen(self, x: float, v: float) -> None:
        space = self.evaluated(x, v, self.values)
        for i, (condition, name, value) in enumerate(self._events):
            now = bool(eval(condition, space))
            if now and not self._held[i]:
                self.values[name] = float(eval(value, space))
            self._held[i] = now

    def step(self, x: Callable[[float], float], v: Callable[[float], float], at: float, h: float) -> float:
        """Advance by classical Runge-Kutta and return the force."""
        # just after the point: the side the motion goes to
        self._happen(x(at + 1e-9), v(at + 1e-9))
        y = self.values
        k = [self.slopes(x(at), v(at), y)]
        for share in (0.5, 0.5, 1.0):
            k.append(self.slopes(x(at + share * h), v(at + share * h), y | {s: y[s] + share * h * k[-1][s] for s in self.states}))
        self.values = y | {s: y[s] + h / 6 * (k[0][s] + 2 * k[1][s] + 2 * k[2][s] + k[3][s]) for s in self.states}
        self._happen(x(at + h), v(at + h))
        return float(self.evaluated(x(at + h), v(at + h), self.values)["force"])


def terms_of(text: str, model: str) -> list[Model]:
    """Return the laws an element model adds up, and check that its equation does add them."""
    body = block(text, "model", model)
    found = []
    for law, arguments in re.findall(r"Laws\.(\w+) term\d+\((.*), x = s_rel - rest, v = v_rel\);", body):
        pairs = re.findall(r"(\w+) = (\{[^}]*\}|[^,]+)", arguments)
        found.append(Model(text, law, {k: eval(v.replace("{", "[").replace("}", "]")) for k, v in pairs}))
    total = " + ".join(["preload", *(f"term{i + 1}.force" for i in range(len(found)))])
    assert f"  f = {total};" in body
    return found


def motion(reach: float) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """Return a motion at two frequencies, at rest at the start, and its rate."""

    def parts(t: float, which: int) -> float:
        total = 0.0
        for a, w in ((0.7 * reach, 25.0), (0.3 * reach, 90.0)):
            total += a * (1 - math.cos(w * t)) * math.cos(4 * t) if which == 0 else (
                a * w * math.sin(w * t) * math.cos(4 * t) - 4 * a * (1 - math.cos(w * t)) * math.sin(4 * t)
            )
        return total

    return (lambda t: parts(t, 0)), (lambda t: parts(t, 1))


@pytest.fixture(scope="module")
def package() -> str:
    """The examples of all elements that have equations, in one package."""
    elements = [exported(kind, "z", cls.example(), {}, None) for kind, cls in kinds().items() if kind not in REFUSED]
    return package_text("all kinds", elements, ["every law"])


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind not in REFUSED])
def test_the_equations_give_the_force_of_the_element(package: str, kind: str) -> None:
    element = kinds()[kind].example()
    # buffers are met in compression only
    x, v = motion(-0.03 if any(word in kind for word in ("jounce", "buffer", "contact", "weighted", "stop")) else 0.012)
    laws = terms_of(package, kind)
    forces = [sum(law.evaluated(x(0.0), v(0.0), law.values)["force"] for law in laws)]
    for t in TIME[:-1]:
        forces.append(sum(law.step(x, v, float(t), STEP) for law in laws))
    codes, params = pack_terms(element.terms())
    own_x, own_v = (np.array([f(float(t)) for t in TIME]) for f in (x, v))
    own = response(codes, params, own_x, own_v, STEP, initial_states(codes, params))
    assert np.abs(own).max() > 10.0, "the law is at work"
    # both see the motion in steps: the element straight pieces, this test Runge-Kutta stages
    assert np.abs(np.array(forces) - own).max() < 5e-3 * np.abs(own).max()


def test_names_numbers_and_texts_are_in_order(package: str) -> None:
    opened = re.findall(r"^ *(?:partial )?(package|model|record|function) (\w+) \"", package, re.M)
    closed = re.findall(r"^ *end (\w+);", package, re.M)
    closed = [word for word in closed if word not in ("if", "while", "when")]
    assert sorted([*(n for _, n in opened), "Law"]) == sorted(closed), "only the base class of the laws has no words of its own"
    assert len({n for _, n in opened}) == len(opened)
    for opening, closing in ("()", "[]", "{}"):
        plain = re.sub(r'"(?:\\.|[^"\\])*"', "", package)
        assert plain.count(opening) == plain.count(closing)
    assert '"' not in re.sub(r'"(?:\\.|[^"\\])*"', "", package), "every text ends"


def test_what_is_known_of_a_parameter_stands_beside_it() -> None:
    seen = DataRange(0.004, (0.5, 20.0), (-100.0, 40.0))
    priors = {"stiffness": Prior(127.1e3, 900.0, 1e5, 2e5, 'bench "B"')}
    text = package_text("bush", [exported("bush.z", "z", ModifiedBerg.example(), priors, seen)], ['a "head"'])
    (line,) = (line for line in text.splitlines() if "known_stiffness(" in line)
    for words in ("value = 127100.0", "std = 900.0", "lower = 100000.0", "upper = 200000.0", "largest_deflection = 0.004",
                  "lowest_frequency = 0.5", "highest_frequency = 20.0"):  # fmt: skip
        assert words in line
    assert "preload -100 to 40 N" in text


def test_an_element_about_an_axis_is_a_rotational_one() -> None:
    text = package_text("m", [exported("m.roll", "roll", kinds()["kelvin_voigt"].example(), {}, None)], ["m"])
    body = block(text, "model", "m_roll")
    assert "Modelica.Mechanics.Rotational.Interfaces.PartialCompliantWithRelativeStates" in body
    assert "x = phi_rel - rest, v = w_rel" in body
    assert "tau = preload + term1.force;" in body
    assert '"N m/rad"' in body


@pytest.mark.parametrize("kind", REFUSED)
def test_a_law_without_equation_is_refused_in_words(kind: str) -> None:
    with pytest.raises(ConfigurationError, match="fmi3"):
        package_text("m", [exported("m.z", "z", kinds()[kind].example(), {}, None)], ["m"])
