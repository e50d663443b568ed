# Copyright 2026 ride_estimation contributors
"""YAML from outside: safe types only, bounded in size and depth, numbers as they are written.

Numbers follow YAML 1.2: ``010`` is ten, ``0x1F`` and ``1:30`` are texts, as dates are. YAML 1.1, which PyYAML speaks, makes
eight, thirty-one and ninety of them, the last in a time that grows with the square of its length.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, ClassVar

import yaml

#: most levels of nesting; the deepest vehicle file has 8. The C parser recurses per level and would overflow its stack
DEEPEST = 64
#: most values a document may have; the largest vehicle file has a thousandth of it
LARGEST_DOCUMENT = 200_000
#: most digits of an integer, what 64 bits hold; more are read as text, which a number may be as well
_MOST_DIGITS = 19

_INTEGER = re.compile(rf"[-+]?[0-9]{{1,{_MOST_DIGITS}}}$")
_FLOAT = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?$|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$")
_TAG = "tag:yaml.org,2002:"


class Located(dict[str, Any]):
    """A mapping of a document that knows in which line of the file every key stands."""

    __slots__ = ("lines",)

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[str, int] = {}


# the safe loader, in C where the installed PyYAML has it (fifteen times faster)
_BASE: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_BASE):  # type: ignore[misc]
    """The safe loader with the numbers of YAML 1.2."""

    yaml_implicit_resolvers: ClassVar[dict[str, list[Any]]] = {
        first: [pair for pair in pairs if pair[0] not in (f"{_TAG}int", f"{_TAG}float", f"{_TAG}timestamp")]
        for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def _integer(loader: Any, node: Any) -> int:
    text = loader.construct_scalar(node)
    if not _INTEGER.match(text):
        raise yaml.constructor.ConstructorError(None, None, f"not an integer of at most {_MOST_DIGITS} digits", node.start_mark)
    return int(text)


def _float(loader: Any, node: Any) -> float:
    text = loader.construct_scalar(node)
    if not _FLOAT.match(text):
        raise yaml.constructor.ConstructorError(None, None, "not a decimal number", node.start_mark)
    return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))


def _mapping(loader: Any, node: Any) -> Iterator[Located]:
    found = Located()
    yield found
    found.update(loader.construct_mapping(node))
    found.lines = {key.value: key.start_mark.line + 1 for key, _ in node.value if isinstance(key, yaml.ScalarNode)}


_Loader.add_implicit_resolver(f"{_TAG}int", _INTEGER, list("-+0123456789"))
_Loader.add_implicit_resolver(f"{_TAG}float", _FLOAT, list("-+0123456789."))
_Loader.add_constructor(f"{_TAG}int", _integer)
_Loader.add_constructor(f"{_TAG}float", _float)
_Loader.add_constructor(f"{_TAG}map", _mapping)


def parse_yaml(text: str) -> tuple[Any, list[str]]:
    """Return the document in a text and one sentence per key that a mapping holds twice.

    Mappings are :class:`Located`.

    Raises
    ------
    ValueError
        Not valid YAML, nested too deeply, too many values, or a tag that names a type.
    """
    try:
        _check_depth(text)
        loader = _Loader(text)
        try:
            root = loader.get_single_node()
            if root is None:
                return None, []
            _expanded(root, {})
            twice = list(_keys_given_twice(root))
            return loader.construct_document(root), twice
        finally:
            loader.dispose()
    except (yaml.YAMLError, TypeError, ArithmeticError, LookupError, AttributeError, RecursionError) as error:
        raise ValueError(" ".join(str(error).replace('"<unicode string>", ', "").split())) from error


def _check_depth(text: str) -> None:
    """Walk through the events, which needs no recursion, before anything is built of them."""
    depth = 0
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEEPEST:
                raise ValueError(f"nested more than {DEEPEST} levels deep in line {event.start_mark.line + 1}")  # type: ignore[union-attr]
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _expanded(node: Any, known: dict[int, int]) -> int:
    """Return the number of values of a document with every alias written out.

    Raises
    ------
    ValueError
        An alias stands inside what it refers to, or there are more values than :data:`LARGEST_DOCUMENT`: a few lines of aliases
        of aliases can stand for more values than fit into the memory.
    """
    if not isinstance(node, yaml.CollectionNode):
        return 1
    if id(node) not in known:
        known[id(node)] = 0
        children = [child for pair in node.value for child in pair] if isinstance(node, yaml.MappingNode) else node.value
        known[id(node)] = 1 + sum(_expanded(child, known) for child in children)
    if known[id(node)] == 0:
        raise ValueError("an alias refers to what it stands in")
    if known[id(node)] > LARGEST_DOCUMENT:
        raise ValueError(f"more than {LARGEST_DOCUMENT} values when aliases are written out")
    return known[id(node)]


def _keys_given_twice(node: Any) -> Iterator[str]:
    """Yield a problem per key that a mapping holds twice; plain YAML keeps the last one silently."""
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, value in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    yield f"key {key.value!r} is given twice, the second time in line {key.start_mark.line + 1}"
                seen.add(key.value)
            yield from _keys_given_twice(value)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            yield from _keys_given_twice(value)
