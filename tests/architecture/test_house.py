"""The house's own rules: floors, style, types, kernels, sizes, and the tree that the README draws."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rcsa_ident"
SOURCES = sorted(p for folder in ("rcsa_ident", "api", "tests", "benchmarks") for p in (ROOT / folder).rglob("*.py"))
KERNELS = sorted(PACKAGE.rglob("_*kernels.py"))


def run(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run one of the tools that are installed beside this interpreter."""
    program = shutil.which(command[0], path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    assert program, f"{command[0]} is not installed"
    return subprocess.run([program, *command[1:]], cwd=ROOT, capture_output=True, text=True, env={**os.environ, **environment}, check=False)


def passes(*command: str, **environment: str) -> None:
    result = run(*command, **environment)
    assert result.returncode == 0, (result.stdout + result.stderr)[-4000:]


def test_imports_point_down():
    passes("lint-imports", "--no-cache")


def test_lint():
    passes("ruff", "check", ".")


def test_format():
    passes("ruff", "format", "--check", ".")


def test_types():
    passes("mypy")


@pytest.mark.parametrize("path", KERNELS, ids=lambda p: f"{p.parent.name}{p.stem}")
def test_kernels_see_arrays_and_scalars_only(path):
    """And named tuples of them: they import numpy, numba and math, take ten arguments at most, and stay serial and cached."""
    tree = ast.parse(path.read_text())
    imported = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add((node.module or "").split(".")[0])
    assert imported <= {"__future__", "math", "numba", "numpy", "typing"}
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    assert functions
    for function in functions:
        arguments = function.args
        count = len(arguments.posonlyargs) + len(arguments.args) + len(arguments.kwonlyargs)
        assert count <= 10, f"{path.parent.name}.{function.name} takes {count} arguments"
        for decorator in function.decorator_list:
            words = ast.unparse(decorator)
            if "njit" in words:
                assert "cache=True" in words, f"{function.name}: {words}"
                assert "parallel" not in words, f"{function.name}: {words}"


def tests_of(path: Path) -> Path:
    """Of ``room/_kernels.py`` they stand in ``tests/room/test_kernels.py``."""
    return ROOT / "tests" / path.parent.relative_to(PACKAGE) / f"test{path.name}"


def test_kernels_have_their_tests():
    assert not [path for path in KERNELS if not tests_of(path).exists()]


def test_kernels_need_no_types():
    """The compiler infers them: the checker is told so, file by file, since its patterns know whole names only."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        overrides = tomllib.load(file)["tool"]["mypy"]["overrides"]
    untyped = next(each["module"] for each in overrides if each.get("disallow_untyped_defs") is False)
    assert sorted(untyped) == [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in KERNELS]


def test_kernels_without_the_compiler():
    """The same tests, with the kernels as plain Python: no result rests on what the compiler lets pass."""
    tests = [str(tests_of(path)) for path in KERNELS]
    passes(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests, NUMBA_DISABLE_JIT="1")


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_file_is_too_long(path):
    assert len(path.read_text().splitlines()) <= 500


def test_no_set_up_beside_pyproject():
    for name in ("setup.py", "setup.cfg", "Makefile", "requirements.txt", "tox.ini", ".flake8", "mypy.ini", "pytest.ini"):
        assert not (ROOT / name).exists()


def test_importing_does_nothing_heavy():
    """The package's door imports no physics, no web, no plots."""
    code = "import sys, rcsa_ident; print([m for m in ('numpy', 'numba', 'fastapi', 'pymoo', 'matplotlib', 'control') if m in sys.modules])"
    assert run(sys.executable, "-c", code).stdout.strip() == "[]"


def drawn_tree() -> set[str]:
    """Files and folders of the README's fenced block that begins with ``rcsa_ident/``.

    A line is ``folder/  module module ...`` or ``file file ...``, indented below its folder; a ``#`` begins a remark.
    """
    text = (ROOT / "README.md").read_text() if (ROOT / "README.md").exists() else ""
    for block in re.findall(r"^```[a-z]*\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE):
        lines = [line for line in block.splitlines() if line.split("#")[0].strip()]
        if lines and lines[0].startswith("rcsa_ident/"):
            break
    else:
        pytest.fail("README.md has no fenced block that begins with 'rcsa_ident/'")
    paths: set[str] = set()
    parents: list[tuple[int, str]] = []
    for line in lines:
        indent, words = len(line) - len(line.lstrip()), line.split("#")[0].split()
        parents = [(depth, name) for depth, name in parents if depth < indent]
        above = "".join(name for _, name in parents)
        if words[0].endswith("/"):
            parents.append((indent, words[0]))
            above += words[0]
            paths.add(above.rstrip("/"))
            words = words[1:]
        paths |= {above + (word.rstrip("/") if "." in word or word.endswith("/") else f"{word}.py") for word in words}
    return paths


def test_the_readme_draws_the_tree_that_stands():
    """Every module of the package is drawn, and nothing that is not there."""
    drawn = drawn_tree()
    missing = sorted(path for path in drawn if not (ROOT / path).exists())
    assert not missing, f"drawn, but not there: {missing}"
    modules = {str(p.relative_to(ROOT)) for p in PACKAGE.rglob("*.py") if p.name != "__init__.py"}
    assert modules <= drawn, f"there, but not drawn: {sorted(modules - drawn)}"


def test_every_setting_of_the_service_is_described():
    from api.settings import Settings

    table = [line.split("|")[1] for line in (ROOT / "docs" / "service.md").read_text().splitlines() if line.startswith("| `")]
    described = {name for cell in table for name in re.findall(r"`([A-Z_]+)`", cell)}
    assert {name.upper() for name in Settings.__dataclass_fields__} == described


def test_defaults_of_the_service_are_told_as_they_are():
    """Every number in the column of defaults is the code's."""
    from api.settings import Settings

    units, default = {"": 1, "MB": 10**6, "GB": 10**9, "MiB": 1}, Settings()
    told: dict[str, float] = {}
    for line in (ROOT / "docs" / "service.md").read_text().splitlines():
        if line.startswith("| `"):
            names, values = (cell.strip() for cell in line.split("|")[1:3])
            numbers = [re.fullmatch(r"([0-9 ]+?) ?([A-Za-z]*)", value) for value in values.split(", ")]
            named = re.findall(r"`([A-Z_]+)`", names)
            assert len(named) == len(numbers) or not all(numbers), line
            told |= {name: int(n[1].replace(" ", "")) * units[n[2]] for name, n in zip(named, numbers, strict=False) if n}
    assert len(told) > 25
    assert told == {name: getattr(default, name.lower()) for name in told}
