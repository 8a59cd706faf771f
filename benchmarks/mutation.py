"""Mutation testing: one operator, constant or comparison of a module is another, and its own tests must notice.

``python -m benchmarks mutation rcsa_ident/machine/_kernels.py`` changes one place at a time, up to ``--most`` of them, which a seed
chooses, and runs the tests that belong to the module (``--tests``, by default those of its name under tests/) without the compiler, until
one fails. A mutant that no test notices survives; it is printed with its line, before and after. ``--line N`` takes the mutants of a line
alone. What survives although it changes nothing stands in ``benchmarks/mutation_equivalent.toml`` with its reason, and is not counted.

The module, its tests and their libraries are imported once. Every mutant is a fork of that process, in which the code of the function is
another; files stay as they are.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import importlib
import io
import os
import random
import signal
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
#: Longest run of a mutant's tests, in runs of the module as it is, and at least [s].
_TIMES, _LEAST = 5.0, 10.0
_BINARY: dict[type[ast.operator], tuple[type[ast.operator], ...]] = {
    ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Div,), ast.Div: (ast.Mult,), ast.FloorDiv: (ast.Mult,), ast.Mod: (ast.Mult,),
    ast.Pow: (ast.Mult,), ast.MatMult: (), ast.BitAnd: (ast.BitOr,), ast.BitOr: (ast.BitAnd,), ast.BitXor: (ast.BitAnd,),
    ast.LShift: (ast.RShift,), ast.RShift: (ast.LShift,),
}  # fmt: skip
_COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
_NAMED = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "sin": "cos",
    "cos": "sin",
    "floor": "ceil",
    "ceil": "floor",
}


class Mutant(NamedTuple):
    """A change at one place.

    `function`: qualified name of the outermost function around it
    `before`, `after`: the smallest expression around it
    `tree`: returns the module with the change, which few of all mutants are asked for
    """

    function: str
    line: int
    before: str
    after: str
    tree: Callable[[], ast.Module]


def main(arguments: list[str]) -> None:
    """Mutate modules one after the other."""
    parser = argparse.ArgumentParser(prog="benchmarks mutation", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="+", help="files of modules, from the repository's root")
    parser.add_argument("--tests", help="files of tests, divided by commas")
    parser.add_argument("--most", type=int, default=80)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--line", type=int)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="after which no further mutant is tried, each module")
    given = parser.parse_args(arguments)
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    for module in given.modules:
        tests = given.tests.split(",") if given.tests else [own_tests(module)]
        print(_line(module, *score(module, tests, given.most, given.seed, given.line, given.seconds)), flush=True)


def own_tests(module: str) -> str:
    """Return the file of tests that belongs to a module: of rcsa_ident/machine/_kernels.py it is tests/machine/test_kernels.py."""
    package, *rooms, name = Path(module).with_suffix("").parts
    if rooms[-1:] == ["_kernels"]:
        rooms, name = rooms[:-1], f"{name}_kernels"
    return str(Path("tests", *(["api"] if package == "api" else []), *rooms, f"test_{name.lstrip('_')}.py"))


def _line(module: str, killed: int, survivors: int, equivalent: int, seconds: float) -> str:
    counted = killed + survivors
    share = 100.0 * killed / counted if counted else 100.0
    return f"| {module} | {killed} of {counted} | {share:.0f} % | {equivalent} | {seconds / 60.0:.1f} min |"


def score(
    module: str, tests: list[str], most: int, seed: int, line: int | None = None, seconds: float = float("inf")
) -> tuple[int, int, int, float]:
    """Return how many mutants were noticed, how many were not, how many of these change nothing, and the time all took [s].

    `module`: file of the module, from the repository's root
    `tests`: files of its tests
    `most`: mutants that are tried, chosen by the seed
    `line`: of the mutants that are tried, where not all are meant
    `seconds`: after which no further one is tried
    """
    source = (ROOT / module).read_text(encoding="utf-8")
    found = [mutant for mutant in mutants(source) if line is None or mutant.line == line]
    trial = _Trial(module, random.Random(seed).sample(found, min(most, len(found))), seconds)
    import pytest

    begun = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main(["-q", "-x", "-p", "no:cacheprovider", *tests], plugins=[trial])
    if not trial.sound:
        raise SystemExit(f"{', '.join(tests)}: they fail though nothing has changed, or hold no test")
    return trial.killed, trial.survivors, trial.same, time.perf_counter() - begun


class _Trial:
    """A plugin of pytest: in the place of one run of the collected tests there is one for every mutant, each in a fork.

    `seconds`: after which no further one is tried
    """

    def __init__(self, module: str, chosen: list[Mutant], seconds: float) -> None:
        self.module, self.chosen, self.end = module, chosen, time.perf_counter() + seconds
        self.killed = self.survivors = self.same = 0
        #: Whether there are tests, and they pass while nothing has changed.
        self.sound = False

    def pytest_runtestloop(self, session: Any) -> bool:
        """Run the tests as they are, and then with each mutant."""
        imported = importlib.import_module(".".join(Path(self.module).with_suffix("").parts))
        begun = os.times().children_user
        if not session.items or _forked(lambda: _failed(session), 600.0):
            return True
        self.sound = True
        limit = max(_TIMES * (os.times().children_user - begun), _LEAST)
        known = {(each["module"], name, each["before"], each["after"]) for each in equivalent() for name in each["functions"]}
        for mutant in self.chosen:
            if time.perf_counter() > self.end:
                break
            if (self.module, mutant.function, mutant.before, mutant.after) in known:
                self.same += 1
            elif _forked(partial(_mutated, imported, mutant, session), limit):
                self.killed += 1
            else:
                self.survivors += 1
                told = f"{self.module}:{mutant.line}: {mutant.function}: {mutant.before}  ->  {mutant.after}"
                print(told, file=sys.__stdout__, flush=True)
        return True


def equivalent() -> list[dict[str, Any]]:
    """Return the mutants that change nothing, each with its functions and its reason; that of a module's own numbers has no name."""
    found: list[dict[str, Any]] = tomllib.loads((ROOT / "benchmarks" / "mutation_equivalent.toml").read_text(encoding="utf-8"))["mutants"]
    return found


def _forked(run: Callable[[], bool], limit: float) -> bool:
    """Return what a function returns in a fork of this process; one that takes too long or dies is true."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            with open(os.devnull, "w", encoding="utf-8") as sink:
                os.dup2(sink.fileno(), 1)
                os.dup2(sink.fileno(), 2)
            signal.setitimer(signal.ITIMER_PROF, limit)
            signal.signal(signal.SIGPROF, signal.SIG_DFL)
            code = int(run())
        finally:
            os._exit(code)
    return os.waitpid(child, 0)[1] != 0


def _failed(session: Any) -> bool:
    """Run the tests that pytest has collected until one fails."""
    for item, following in zip(session.items, [*session.items[1:], None], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        if session.testsfailed:
            return True
    return False


def _mutated(module: Any, mutant: Mutant, session: Any) -> bool:
    """Put the change in place of the function's own code, wherever that is bound by now, and run the tests."""
    code = compile(mutant.tree(), module.__file__, "exec")
    if mutant.function:
        owner: Any = module
        *outer, name = mutant.function.split(".")
        for each in outer:
            owner = getattr(owner, each)
        own = owner.__dict__[name]
        own = own.fget if isinstance(own, property) else getattr(own, "__func__", own)
        while not isinstance(own, FunctionType) or hasattr(own, "__wrapped__"):
            own = own.__wrapped__
        own.__code__ = _inner(code, mutant.function.split("."))
    else:
        exec(code, fresh := dict(module.__dict__))
        for name, value in fresh.items():
            if not callable(value) and not name.startswith("__"):
                setattr(module, name, value)
    return _failed(session)


def _inner(code: CodeType, names: list[str]) -> CodeType:
    for name in names:
        code = next(each for each in code.co_consts if isinstance(each, CodeType) and each.co_name == name)
    return code


def mutants(source: str) -> Iterator[Mutant]:
    """Yield every change of a module's functions and numbers; annotations, defaults, decorators and texts stay as they are."""
    tree = ast.parse(source)
    for n, statement in enumerate(tree.body):
        for place, function in _places(statement, ""):
            for change in _changes(place):
                changed = copy.deepcopy(place)
                change(changed)
                yield Mutant(function, place.lineno, ast.unparse(place), ast.unparse(changed), partial(_with, tree, n, place, change))


def _with(tree: ast.Module, n: int, place: ast.AST, change: Callable[[Any], None]) -> ast.Module:
    """Return a module with one place of its n-th statement changed."""
    twin = copy.deepcopy(tree.body[n])
    change(next(node for node in ast.walk(twin) if _same(node, place)))
    return ast.Module([*tree.body[:n], ast.fix_missing_locations(twin), *tree.body[n + 1 :]], [])


def _same(node: ast.AST, place: ast.AST) -> bool:
    spots = ("lineno", "col_offset", "end_lineno", "end_col_offset")
    return type(node) is type(place) and all(getattr(node, spot, None) == getattr(place, spot, None) for spot in spots)


def _places(node: ast.AST, function: str, inside: bool = False) -> Iterator[tuple[Any, str]]:
    """Nodes that may change, with the outermost function around each."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        name = function if inside else f"{function}.{node.name}".lstrip(".")
        for each in node.body:
            yield from _places(each, name, inside or not isinstance(node, ast.ClassDef))
        return
    if hasattr(node, "lineno"):
        yield node, function if inside else ""
    for field, value in ast.iter_fields(node):
        if field not in ("annotation", "returns", "decorator_list", "format_spec"):
            for each in value if isinstance(value, list) else [value]:
                if isinstance(each, ast.AST):
                    yield from _places(each, function, inside)


def _changes(node: Any) -> Iterator[Callable[[Any], None]]:
    def put(field: str, value: Any) -> Callable[[Any], None]:
        return lambda own: setattr(own, field, value)

    match node:
        case ast.BinOp() | ast.AugAssign():
            yield from (put("op", other()) for other in _BINARY[type(node.op)])
        case ast.Compare(ops=[op]):
            yield from (put("ops", [other()]) for other in _COMPARED[type(op)])
        case ast.BoolOp():
            yield put("op", ast.And() if isinstance(node.op, ast.Or) else ast.Or())
        case ast.UnaryOp(op=ast.USub()):
            yield put("op", ast.UAdd())
        case ast.UnaryOp(op=ast.Not()):
            yield lambda own: (setattr(own, "op", ast.Not()), setattr(own, "operand", ast.UnaryOp(ast.Not(), own.operand)))[0]
        case ast.Constant(value=bool(value)):
            yield put("value", not value)
        case ast.Constant(value=int(value) | float(value)):
            yield put("value", value + 1)
        case ast.Attribute(attr=name) | ast.Name(id=name) if name in _NAMED:
            yield put("attr" if isinstance(node, ast.Attribute) else "id", _NAMED[name])
        case ast.Break() | ast.Continue():
            other = ast.Continue if isinstance(node, ast.Break) else ast.Break
            yield lambda own: setattr(own, "__class__", other)


if __name__ == "__main__":
    main(sys.argv[1:])
