"""The house's own rules: kernels, sizes, the README's length, and the tree that CONTRIBUTING draws."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fixtures.kept_kernels import kernel_files

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "rcsa_ident"
SOURCES = sorted(p for folder in ("rcsa_ident", "api", "tests", "benchmarks") for p in (ROOT / folder).rglob("*.py"))
#: Rooms whose rounding the search of an identification follows.
SEARCHED = {"identification", "coupled", "tool_holder"}
KERNELS = kernel_files(PACKAGE)


def test_kernels_see_arrays_and_scalars_only():
    """And named tuples of them: they import numpy, numba and math, take ten arguments at most, and stay serial and cached.

    What a search rests on rounds as it is written: where the compiler may regroup and fuse, it does so from build to build in another way,
    and the same seed ends elsewhere.
    """
    for path in KERNELS:
        tree = ast.parse(path.read_text())
        imported = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add((node.module or "").split(".")[0])
        assert imported <= {"__future__", "math", "numba", "numpy", "typing"}, path
        functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
        assert functions, path
        for function in functions:
            arguments, place = function.args, f"{path.stem}.{function.name}"
            count = len(arguments.posonlyargs) + len(arguments.args) + len(arguments.kwonlyargs)
            assert count <= 10, f"{place} takes {count} arguments"
            for words in (ast.unparse(decorator) for decorator in function.decorator_list):
                if "njit" in words:
                    assert "cache=True" in words, f"{place}: {words}"
                    assert "parallel" not in words, f"{place}: {words}"
                    assert not SEARCHED & set(path.parts) or "fastmath" not in words, f"{place}: {words}"


def file_of_tests(path: Path) -> Path:
    """Of ``room/_kernels.py`` it is ``tests/room/test_kernels.py``, of ``room/_kernels/cut.py`` ``tests/room/test_cut_kernels.py``."""
    within, room = path.parent.name == "_kernels", path.relative_to(PACKAGE).parent
    return ROOT / "tests" / (room.parent / f"test_{path.stem}_kernels.py" if within else room / "test_kernels.py")


def test_kernels_have_their_tests():
    assert not [path for path in KERNELS if not file_of_tests(path).exists()]


def test_no_file_is_too_long():
    lengths = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in SOURCES}
    assert {name: length for name, length in lengths.items() if length > 500} == {}


def test_no_set_up_beside_pyproject():
    for name in ("setup.py", "setup.cfg", "Makefile", "requirements.txt", "tox.ini", ".flake8", "mypy.ini", "pytest.ini"):
        assert not (ROOT / name).exists()


def test_importing_does_nothing_heavy():
    """The package's door imports no physics, no web, no plots."""
    code = "import sys, rcsa_ident; print([m for m in ('numpy', 'numba', 'fastapi', 'pymoo', 'matplotlib', 'control') if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], cwd=ROOT, text=True).strip() == "[]"


def test_one_place_turns_speeds_into_rad_per_s():
    """30/π and π/30 stand in units.py and nowhere else, whether written as a quotient or as digits."""
    factor = re.compile(r"\b30(\.0*)?\s*/\s*(np|math)\.pi|(np|math)\.pi\s*/\s*30\b|\b9\.549\d|\b0\.1047\d")
    offenders = set()
    for path in (p for folder in ("rcsa_ident", "api") for p in (ROOT / folder).rglob("*.py")):
        if factor.search(path.read_text()):
            offenders.add(str(path.relative_to(ROOT)))
    assert offenders == {"rcsa_ident/base/units.py"}


@pytest.mark.slow
def test_errors_are_in_the_words_of_the_library():
    """No option of the command line stands in a text outside cli/: the commands turn the library's fields into their options."""
    option = re.compile(r"(^| )--[a-z][a-z-]+( |$|[,;.)])")
    offenders = []
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.is_relative_to(PACKAGE / "cli"):
            continue
        tree = ast.parse(path.read_text())
        documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        texts = [n for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str) and id(n) not in documents]
        offenders += [f"{path.relative_to(ROOT)}:{text.lineno}" for text in texts if option.search(text.value)]
    # the last one is an option of Dask's own worker
    assert [offender.split(":")[0] for offender in offenders] == ["rcsa_ident/base/scaleout.py"], offenders


def drawn_tree() -> set[str]:
    """Files and folders of the fenced block of docs/CONTRIBUTING.md that begins with ``rcsa_ident/``.

    A line is ``folder/  module module ...`` or ``file file ...``, indented below its folder; a ``#`` begins a remark.
    """
    text = (ROOT / "docs" / "CONTRIBUTING.md").read_text(encoding="utf-8")
    for block in re.findall(r"^```[a-z]*\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE):
        lines = [line for line in block.splitlines() if line.split("#")[0].strip()]
        if lines and lines[0].startswith("rcsa_ident/"):
            break
    else:
        pytest.fail("docs/CONTRIBUTING.md has no fenced block that begins with 'rcsa_ident/'")
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


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 200


def test_contributing_draws_the_tree_that_stands():
    """Every module of the package is drawn, and nothing that is not there."""
    drawn = drawn_tree()
    missing = sorted(path for path in drawn if not (ROOT / path).exists())
    assert not missing, f"drawn, but not there: {missing}"
    modules = {str(p.relative_to(ROOT)) for p in PACKAGE.rglob("*.py") if p.name != "__init__.py"}
    assert modules <= drawn, f"there, but not drawn: {sorted(modules - drawn)}"


def test_the_settings_of_the_service_are_described_as_they_are():
    """Names, defaults, ranges and texts: the table is the model's."""
    from api.settings import table

    assert table() in (ROOT / "docs" / "service.md").read_text()
