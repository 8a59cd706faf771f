"""What import contracts cannot say: what a module takes from others is public, stands in a graph without circles, and is named openly."""

from __future__ import annotations

import ast
import graphlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.fixtures.reach import modules


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def of(*rooms: str) -> Iterator[tuple[str, ast.Module]]:
    yield from ((name, tree_of(path)) for name, path in modules().items() if name.split(".")[0] in rooms)


def taken(*rooms: str) -> Iterator[tuple[str, str, str]]:
    """Yield who takes from which module which name."""
    for own, tree in of(*rooms):
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                yield from ((own, str(node.module), alias.name) for alias in node.names)


def test_nobody_takes_what_is_private():
    """Kernels, which are private to their room, are asked by others through a public function of it."""
    names = {(own, source, name) for own, source, name in taken("rcsa_ident", "api") if re.match(r"_(?!_|kernels$)", name)}
    assert names == set()
    kernels = {(own, source) for own, source, name in taken("rcsa_ident") if "_kernels" in (*source.split("."), name)}
    strangers = {own for own, source in kernels if own.split(".")[1] != source.split(".")[1]}
    assert strangers == {"rcsa_ident.identification.arm.joints"}


def test_benchmarks_stand_in_no_circle():
    asked: dict[str, set[str]] = {}
    for own, source, name in taken("benchmarks"):
        asked.setdefault(own, set()).update({source, f"{source}.{name}"} & modules().keys() - {"benchmarks"})
    graphlib.TopologicalSorter(asked).prepare()


def test_nobody_names_what_stands_above_in_a_text():
    """No contract would see the arrow; nouns' door is the only one: an import there would have every module reach every other."""
    above = {name for name in modules() if name.startswith(("rcsa_ident.front", "rcsa_ident.cli", "api"))}
    named = {(own, node.value) for own, tree in of("rcsa_ident") for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    named = {(own, text) for own, text in named if text in above and "." in str(text) and not own.startswith("rcsa_ident.cli")}
    assert named == {("rcsa_ident.base.shown", "rcsa_ident.front.notebook")}


def test_importing_registers_nothing_elsewhere():
    """A module calls on import, for its effect, nothing but what it has made itself."""
    for own, tree in of("rcsa_ident", "api"):
        foreign = {alias.asname or alias.name for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom) for alias in n.names}
        calls = [node.value.func for node in tree.body if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)]
        assert not [ast.unparse(call) for call in calls if ast.unparse(call).split(".")[0] in foreign], own
