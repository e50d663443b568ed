# Copyright 2026 ride_estimation contributors
"""Nothing without a way in: every public function and class is reached from a command, a node, a launch file or a registry.

The source is read, not run: a definition reaches the names its body uses, resolved through the imports of its module.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "ride_estimation"
#: packages whose modules are found by name at run time: commands, force elements, causes of a discrepancy
REGISTRIES = (f"{PACKAGE}.elements", f"{PACKAGE}.diagnosis.causes")


class Module:
    """One module: its definitions, the names they use, and where its imported names come from."""

    def __init__(self, name: str, tree: ast.Module, package: bool) -> None:
        self.name, self.is_package = name, package
        self.definitions: dict[str, ast.AST] = {}
        self.rest: list[ast.stmt] = []
        for statement in tree.body:
            if isinstance(statement, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                self.definitions[statement.name] = statement
            elif isinstance(statement, (ast.Assign, ast.AnnAssign)) and not _is_public_list(statement):
                targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
                for target in targets:
                    for name_node in ast.walk(target):
                        if isinstance(name_node, ast.Name):
                            self.definitions[name_node.id] = statement
            else:
                self.rest.append(statement)
        self.imports = {alias: target for node in _statements(tree) for alias, target in _imports(node)}


def _statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield every statement; imports are no expressions, and those are most of a tree."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            part = getattr(node, field, ())
            waiting += part if isinstance(part, list) else ()


def _is_public_list(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in statement.targets)


def _imports(node: ast.AST) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.ImportFrom) and node.module:
        for alias in node.names:
            yield alias.asname or alias.name, f"{node.module}.{alias.name}"
    elif isinstance(node, ast.Import):
        for alias in node.names:
            yield (alias.asname, alias.name) if alias.asname else (alias.name.split(".")[0], alias.name.split(".")[0])


def read_modules(root: Path) -> dict[str, Module]:
    """Return the modules of a source tree by dotted name."""
    found = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if package else parts)
        found[name] = Module(name, ast.parse(path.read_text(encoding="utf-8")), package)
    return found


def _dotted(node: ast.AST) -> str:
    """Return ``a.b.c`` of an attribute chain on a name, else nothing."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


def _used(node: ast.AST) -> Iterator[str]:
    for inner in ast.walk(node):
        if isinstance(inner, (ast.Name, ast.Attribute)):
            name = _dotted(inner)
            if name:
                yield name


class Graph:
    """Which definitions a definition uses."""

    def __init__(self, modules: dict[str, Module]) -> None:
        self.modules = modules

    def resolve(self, module: Module, name: str) -> Iterator[tuple[str, str]]:
        """Yield (module, definition) that a name used in a module means; (module, "") for a module itself."""
        first, _, rest = name.partition(".")
        target = module.imports.get(first)
        if target is None:
            if first in module.definitions:
                yield module.name, first
            return
        full = f"{target}.{rest}" if rest else target
        parts = full.split(".")
        for cut in range(len(parts), 0, -1):
            owner = self.modules.get(".".join(parts[:cut]))
            if owner is None:
                continue
            if cut == len(parts):
                yield owner.name, ""
            elif parts[cut] in owner.definitions:
                yield owner.name, parts[cut]
            elif parts[cut] in owner.imports:
                yield from self.resolve(owner, ".".join(parts[cut:]))
            return

    def reached(self, roots: list[tuple[str, str]]) -> set[tuple[str, str]]:
        """Return everything reached from some definitions; what a module does when it is imported counts with it."""
        seen: set[tuple[str, str]] = set()
        waiting = list(roots)
        while waiting:
            place = waiting.pop()
            if place in seen or place[0] not in self.modules:
                continue
            seen.add(place)
            module = self.modules[place[0]]
            waiting.append((place[0], ""))
            nodes = [module.definitions[place[1]]] if place[1] in module.definitions else []
            if not place[1]:
                nodes = [s for s in module.rest if not isinstance(s, (ast.Import, ast.ImportFrom))]
            for node in nodes:
                for name in _used(node):
                    waiting += self.resolve(module, name)
        return seen


def roots(root: Path, modules: dict[str, Module]) -> list[tuple[str, str]]:
    """Return where a user comes in: verbs, entry points of the package, launch files, registered classes, documented API."""
    found: list[tuple[str, str]] = []
    for name, module in modules.items():
        if name.startswith(f"{PACKAGE}.cli.arguments.") and "HELP" in module.definitions:
            found += [(name, "add_arguments"), (name.replace(".arguments.", "."), "run")]
        if name.startswith(REGISTRIES):
            # a registry takes the classes of a module by their KIND, a cause by its functions
            registered = [d for d, node in module.definitions.items() if isinstance(node, ast.ClassDef) and _has_kind(node)]
            found += [(name, d) for d in (registered or (module.definitions if name.startswith(REGISTRIES[1]) else ()))]
        if any(isinstance(s, ast.If) and "__main__" in ast.unparse(s.test) for s in module.rest):
            found.append((name, ""))
    setup = (root / "setup.py").read_text(encoding="utf-8")
    found += [(m, f) for m, f in re.findall(rf"= ?({PACKAGE}[\w.]+):(\w+)", setup)]
    for path in sorted((root / "launch").rglob("*.py")):
        launch = Module("launch", ast.parse(path.read_text(encoding="utf-8")), False)
        found += [tuple(t.rpartition(".")[::2]) for t in launch.imports.values() if t.startswith(PACKAGE)]
    return found + documented(root)


def documented(root: Path) -> list[tuple[str, str]]:
    """Return the names that a page of the docs shows how to import."""
    text = "\n".join(p.read_text(encoding="utf-8") for p in [root / "README.md", *sorted((root / "docs").glob("*.md"))])
    found = []
    for module, names in re.findall(rf"^\s*from ({PACKAGE}[\w.]*) import ([\w, ]+)$", text, flags=re.M):
        found += [(module, name.strip()) for name in names.split(",")]
    return found


def _has_kind(node: ast.ClassDef) -> bool:
    return any(
        isinstance(s, (ast.Assign, ast.AnnAssign)) and "KIND" in ast.unparse(s).partition("=")[0] for s in node.body
    )


def unreached(root: Path) -> list[str]:
    """Return the public functions and classes nothing leads to."""
    modules = read_modules(root)
    seen = Graph(modules).reached(roots(root, modules))
    return [
        f"{name}.{definition}"
        for name, module in modules.items()
        for definition, node in module.definitions.items()
        if not definition.startswith("_") and not isinstance(node, (ast.Assign, ast.AnnAssign)) and (name, definition) not in seen
    ]


def test_every_public_function_and_class_has_a_way_in() -> None:
    assert unreached(ROOT) == []


def test_the_python_interface_runs_as_it_is_written() -> None:
    text = (ROOT / "docs" / "python_api.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for block in re.findall(r"```python\n(.*?)```", text, flags=re.S):
        exec(compile(block, "python_api.md", "exec"), names)


def test_what_nothing_leads_to_is_found(tmp_path: Path) -> None:
    """The search itself: an import alone is no way in, a use is, and so is one through a name passed on."""
    package = tmp_path / PACKAGE
    (package / "cli" / "arguments").mkdir(parents=True)
    (tmp_path / "launch").mkdir()
    (tmp_path / "docs").mkdir()
    for name in ("setup.py", "README.md"):
        (tmp_path / name).write_text("", encoding="utf-8")
    for folder in (package, package / "cli", package / "cli" / "arguments"):
        (folder / "__init__.py").write_text("", encoding="utf-8")
    (package / "core.py").write_text(
        "def used(): return helper()\ndef helper(): return 1\ndef forgotten(): return 2\ndef imported_only(): return 3\n"
        "TABLE = {'a': lambda: through_a_table()}\ndef through_a_table(): return 4\n",
        encoding="utf-8",
    )
    (package / "cli" / "verb.py").write_text(
        f"from {PACKAGE} import core\nfrom {PACKAGE}.core import imported_only\n"
        "def run(options): return core.used() + core.TABLE['a']()\n",
        encoding="utf-8",
    )
    (package / "cli" / "arguments" / "verb.py").write_text("HELP = ''\ndef add_arguments(parser): pass\n", encoding="utf-8")
    assert unreached(tmp_path) == [f"{PACKAGE}.core.forgotten", f"{PACKAGE}.core.imported_only"]
