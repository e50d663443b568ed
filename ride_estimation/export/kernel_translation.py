# Copyright 2026 ride_estimation contributors
"""C text of the force laws, translated from the Python source of the compiled kernels, so that there is one statement of each.

The kernels are a small language: scalars, rows of two arrays (parameters and memory), branches, counted loops. What is outside
it raises an error when the text is made, never when the C runs.
"""

from __future__ import annotations

import ast
import functools
import inspect
import math
from collections.abc import Iterator
from types import ModuleType
from typing import NamedTuple

from ride_estimation.elements import (
    kernels_curve,
    kernels_filter,
    kernels_hysteresis,
    kernels_memory,
    kernels_network,
    kernels_static,
    terms,
)
from ride_estimation.errors import ConfigurationError

_MODULES: tuple[ModuleType, ...] = (
    kernels_static, kernels_memory, kernels_curve, kernels_filter, kernels_hysteresis, kernels_network, terms,
)
#: what the C of a model calls; everything they call is translated with them
_ENTRIES = ("rest_at", "force_at", "commit_at")
_PREFIX = "law_"
_PLAIN_CALLS = {"abs": "fabs", "max": "fmax", "min": "fmin"}
_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "/",
    ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.And: "&&", ast.Or: "||",
}  # fmt: skip
#: words of C that kernels use as names
_TAKEN = frozenset({"static", "const", "double", "signed", "short", "long", "register", "switch", "default", "y0", "y1"})
#: row length of the two arrays, macros of the C text; parameters are called p or params in the kernels, memories s or states
_ROW = {"p": "PARAMETERS", "params": "PARAMETERS", "s": "MEMORY", "states": "MEMORY"}


class _Kernel(NamedTuple):
    module: ModuleType
    tree: ast.FunctionDef


def kernel_source() -> str:
    """Return C functions ``law_rest_at``, ``law_force_at`` and ``law_commit_at`` and all they need, static, C99.

    The text expects ``PARAMETERS`` and ``MEMORY``, the row lengths of the two arrays, to be defined before it.
    """
    return "\n\n".join(_Translator(kernel).text() for kernel in _in_calling_order()) + "\n"


@functools.cache
def _functions(module: ModuleType) -> dict[str, ast.FunctionDef]:
    return {node.name: node for node in ast.parse(inspect.getsource(module)).body if isinstance(node, ast.FunctionDef)}


def _in_calling_order() -> Iterator[_Kernel]:
    """Yield the entries and what they call, callees first."""
    done: set[tuple[str, str]] = set()

    def visit(kernel: _Kernel) -> Iterator[_Kernel]:
        key = (kernel.module.__name__, kernel.tree.name)
        if key in done:
            return
        done.add(key)
        for node in ast.walk(kernel.tree):
            if isinstance(node, ast.Call) and (called := _kernel_called(kernel.module, node)):
                yield from visit(called)
        yield kernel

    for entry in _ENTRIES:
        yield from visit(_Kernel(terms, _functions(terms)[entry]))


def _called(node: ast.Call) -> str:
    return node.func.id if isinstance(node.func, ast.Name) else node.func.attr if isinstance(node.func, ast.Attribute) else ""


def _kernel_called(module: ModuleType, node: ast.Call) -> _Kernel | None:
    """Return the kernel a call in a module goes to, None for calls of Python and of math."""
    name = _called(node)
    space = module
    if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
        space = getattr(module, node.func.value.id)
    called = getattr(space, name, None)
    owners = (m for m in _MODULES if name in _functions(m) and getattr(m, name) is called)
    owner = next(owners, None)
    return None if owner is None else _Kernel(owner, _functions(owner)[name])


def _tuple_size(annotation: ast.expr | None) -> int:
    """Return how many numbers an annotation ``tuple[float, float]`` stands for, 0 for others."""
    if isinstance(annotation, ast.Subscript) and isinstance(annotation.slice, ast.Tuple):
        return len(annotation.slice.elts)
    return 0


def _word(name: str) -> str:
    """Return a name of Python as one of C, where some are taken."""
    return f"{name}_" if name in _TAKEN else name


def _is_array(annotation: ast.expr | None) -> bool:
    return isinstance(annotation, ast.Name) and annotation.id == "Array"


class _Translator:
    """One kernel to one C function."""

    def __init__(self, kernel: _Kernel) -> None:
        self._module, self._tree = kernel
        #: local name -> "int", "double", or "tuple" for a parameter that is an array of numbers
        self._types: dict[str, str] = {}

    def text(self) -> str:
        """Return the C function."""
        arguments = [self._argument(a) for a in self._tree.args.args]
        if _tuple_size(self._tree.returns):
            arguments.append("double *result")
        body = self._block(self._tree.body)
        locals_ = sorted(set(self._types) - {a.arg for a in self._tree.args.args})
        declarations = [f"    {self._types[n]} {_word(n)};" for n in locals_ if self._types[n] != "tuple"]
        head = f"static {self._returned()} {_PREFIX}{self._tree.name.lstrip('_')}({', '.join(arguments)})"
        return "\n".join([head, "{", *declarations, *body, "}"])

    def _returned(self) -> str:
        annotation = self._tree.returns
        if isinstance(annotation, ast.Name):
            return {"float": "double", "int": "int"}[annotation.id]
        return "void"

    def _argument(self, argument: ast.arg) -> str:
        if _is_array(argument.annotation):
            constant = "const " if _ROW[argument.arg] == "PARAMETERS" else ""
            return f"{constant}double *{argument.arg}"
        if _tuple_size(argument.annotation):
            self._types[argument.arg] = "tuple"
            return f"const double *{argument.arg}"
        if not isinstance(argument.annotation, ast.Name):
            raise self._refused(argument)
        self._types[argument.arg] = {"float": "double", "int": "int"}[argument.annotation.id]
        return f"{self._types[argument.arg]} {_word(argument.arg)}"

    def _refused(self, node: ast.AST) -> ConfigurationError:
        return ConfigurationError(
            f"{self._module.__name__}.{self._tree.name}: {type(node).__name__} in line {getattr(node, 'lineno', 0)}"
            " has no translation to C"
        )

    def _block(self, statements: list[ast.stmt], depth: int = 1) -> list[str]:
        return [line for s in statements for line in self._statement(s, depth)]

    def _statement(self, node: ast.stmt, depth: int) -> list[str]:
        pad = "    " * depth
        if isinstance(node, ast.Expr):
            if isinstance(node.value, ast.Constant):
                return []  # docstring
            return [f"{pad}{self._expression(node.value)};"]
        if isinstance(node, ast.Return):
            return self._return(node, pad)
        if isinstance(node, ast.If):
            lines = [f"{pad}if ({self._expression(node.test)}) {{", *self._block(node.body, depth + 1)]
            if node.orelse:
                lines += [f"{pad}}} else {{", *self._block(node.orelse, depth + 1)]
            return [*lines, f"{pad}}}"]
        if isinstance(node, ast.While):
            return [f"{pad}while ({self._expression(node.test)}) {{", *self._block(node.body, depth + 1), f"{pad}}}"]
        if isinstance(node, ast.For):
            return self._for(node, depth)
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            return [pad + line for line in self._assign(node.targets[0], node.value)]
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            return [pad + line for line in self._assign(node.target, node.value)]
        if isinstance(node, ast.AugAssign):
            return [f"{pad}{self._expression(node.target)} {_OPERATORS[type(node.op)]}= {self._expression(node.value)};"]
        raise self._refused(node)

    def _return(self, node: ast.Return, pad: str) -> list[str]:
        if node.value is None:
            return [f"{pad}return;"]
        if isinstance(node.value, ast.Tuple):
            parts = [f"{pad}result[{i}] = {self._expression(v)};" for i, v in enumerate(node.value.elts)]
            return [*parts, f"{pad}return;"]
        return [f"{pad}return {self._expression(node.value)};"]

    def _for(self, node: ast.For, depth: int) -> list[str]:
        counted = node.iter
        if not (isinstance(node.target, ast.Name) and isinstance(counted, ast.Call) and _called(counted) == "range"):
            raise self._refused(node)
        bounds = [self._expression(a) for a in counted.args]
        first, end = ("0", bounds[0]) if len(bounds) == 1 else bounds[:2]
        name = node.target.id
        self._types[name] = "int"
        pad = "    " * depth
        head = f"{pad}for ({name} = {first}; {name} < {end}; {name}++) {{"
        return [head, *self._block(node.body, depth + 1), f"{pad}}}"]

    def _assign(self, target: ast.expr, value: ast.expr) -> list[str]:
        if isinstance(target, ast.Tuple):
            return self._assign_several(target.elts, value)
        if isinstance(target, ast.Name) and isinstance(value, ast.Tuple):
            self._types[target.id] = "tuple"
            numbers = ", ".join(self._expression(v) for v in value.elts)
            return [f"const double {target.id}[{len(value.elts)}] = {{{numbers}}};"]
        if isinstance(target, ast.Name):
            self._types.setdefault(target.id, self._type(value))
        return [f"{self._expression(target)} = {self._expression(value)};"]

    def _assign_several(self, targets: list[ast.expr], value: ast.expr) -> list[str]:
        if isinstance(value, ast.Tuple):
            # no kernel swaps values, so one after the other is the same
            return [line for t, v in zip(targets, value.elts, strict=True) for line in self._assign(t, v)]
        if isinstance(value, ast.Name):
            lines, source = [], value.id
        elif isinstance(value, ast.Call):
            arguments = ", ".join([*(self._expression(a) for a in value.args), "pair"])
            lines, source = [f"double pair[{len(targets)}];", f"{_PREFIX}{_called(value)}({arguments});"], "pair"
        else:
            raise self._refused(value)
        for i, target in enumerate(targets):
            if isinstance(target, ast.Name):
                self._types.setdefault(target.id, "double")
            lines.append(f"{self._expression(target)} = {source}[{i}];")
        return lines

    def _type(self, node: ast.expr) -> str:
        """Return the C type of an expression."""
        if isinstance(node, ast.Constant):
            return "double" if isinstance(node.value, float) else "int"
        if isinstance(node, ast.Name):
            return self._types.get(node.id) or self._type_of_global(getattr(self._module, node.id))
        if isinstance(node, ast.BinOp):
            both = {self._type(node.left), self._type(node.right)}
            return "int" if both == {"int"} and not isinstance(node.op, ast.Div | ast.Pow) else "double"
        if isinstance(node, ast.Call):
            if kernel := _kernel_called(self._module, node):
                returned = kernel.tree.returns
                return "int" if isinstance(returned, ast.Name) and returned.id == "int" else "double"
            return "int" if _called(node) == "int" else "double"
        return "double"

    @staticmethod
    def _type_of_global(value: object) -> str:
        return "int" if isinstance(value, int) else "double"

    def _expression(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant):
            return str(int(node.value)) if isinstance(node.value, bool) else repr(node.value)
        if isinstance(node, ast.Name):
            known = node.id in self._types or node.id in _ROW
            return _word(node.id) if known else self._number(getattr(self._module, node.id), node)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return self._number(getattr(getattr(self._module, node.value.id), node.attr), node)
        if isinstance(node, ast.Subscript):
            return self._subscript(node)
        if isinstance(node, ast.BinOp):
            left, right = self._expression(node.left), self._expression(node.right)
            return f"pow({left}, {right})" if isinstance(node.op, ast.Pow) else f"({left} {_OPERATORS[type(node.op)]} {right})"
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return f"(-{self._expression(node.operand)})"
        if isinstance(node, ast.BoolOp):
            return "(" + f" {_OPERATORS[type(node.op)]} ".join(self._expression(v) for v in node.values) + ")"
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            return self._compare(node)
        if isinstance(node, ast.IfExp):
            return f"({self._expression(node.test)} ? {self._expression(node.body)} : {self._expression(node.orelse)})"
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self._refused(node)

    def _number(self, value: object, node: ast.AST) -> str:
        if not isinstance(value, int | float):
            raise self._refused(node)
        return "INFINITY" if value == float("inf") else "NAN" if math.isnan(value) else repr(value)

    def _compare(self, node: ast.Compare) -> str:
        left, right = self._expression(node.left), node.comparators[0]
        if isinstance(node.ops[0], ast.In) and isinstance(right, ast.Tuple):
            return "(" + " || ".join(f"{left} == {self._expression(v)}" for v in right.elts) + ")"
        return f"({left} {_OPERATORS[type(node.ops[0])]} {self._expression(right)})"

    def _subscript(self, node: ast.Subscript) -> str:
        if not isinstance(node.value, ast.Name):
            # the number of columns, states.shape[1]
            if isinstance(node.value, ast.Attribute) and isinstance(node.value.value, ast.Name) and node.value.attr == "shape":
                return _ROW[node.value.value.id]
            raise self._refused(node)
        if not isinstance(node.slice, ast.Tuple):
            raise self._refused(node)
        row, column = (self._expression(e) for e in node.slice.elts)
        return f"{node.value.id}[{row} * {_ROW[node.value.id]} + {column}]"

    def _call(self, node: ast.Call) -> str:
        called = _called(node)
        arguments = [self._expression(a) for a in node.args]
        if _kernel_called(self._module, node):
            return f"{_PREFIX}{called.lstrip('_')}({', '.join(arguments)})"
        if called == "float":
            return arguments[0]
        if called == "int":
            return f"(int)({arguments[0]})"
        of_math = isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name) and node.func.value.id == "math"
        if called not in _PLAIN_CALLS and not of_math:
            raise self._refused(node)
        return f"{_PLAIN_CALLS.get(called, called)}({', '.join(arguments)})"
