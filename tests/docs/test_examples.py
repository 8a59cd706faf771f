"""Public names: each shows an example that is true, and is documented as the house documents."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import numpy as np
import pytest
from numpydoc.docscrape import get_doc_object
from numpydoc.validate import ERROR_MSGS, validate
from sphinx.pycode import ModuleAnalyzer

import rcsa_ident as ri
from tests.cli.test_path_compensate import robot_result
from tests.fixtures.paths import ROOT
from tests.fixtures.rung_tooling import rung_tooling
from tests.signals.test_tap import RATE, hits

PACKAGE = ROOT / "rcsa_ident"
#: What numpydoc would ask for beyond the house: extended summaries and See Also (noise where one sentence says it), Returns (the summary
#: begins with it, annotations have the type), types and descriptions of parameters whose names or types say all, capitals of symbols.
NOT_ASKED = {"ES01", "SA01", "RT01", "PR04", "PR07", "PR08"}
#: Names that are a choice among members, called with one of them: no parameters of their own.
CHOICES = {"Dof", "Quantity"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """What examples name: the repository's data, the hits of a hammer, a tooling that rings, a robot's result."""
    folder: Path = tmp_path_factory.mktemp("examples")
    (folder / "data").symlink_to(ROOT / "data", target_is_directory=True)
    force, response = hits(count=2)
    table = np.stack([np.arange(force.size) / RATE, force, response], axis=1)
    np.savetxt(folder / "hits.csv", table, delimiter=",", header="time (s),hammer (N),tip (m/s^2)", comments="", fmt="%.9e")
    rung_tooling(folder)
    robot_result(folder / "ROBOT.json", 0.02)
    return folder


def comment(name: str) -> str:
    """Return what stands above a name that is no class and no function."""
    documented = ModuleAnalyzer.for_module(ri._HOME[name]).find_attr_docs()
    return "\n".join(documented["", name])


def run(tests: list[doctest.DocTest]) -> int:
    """Run examples, return how many lines they have."""
    runner = doctest.DocTestRunner(verbose=False)
    for test in tests:
        result = runner.run(test)
        assert not result.failed, test.name
    return runner.summarize(verbose=False).attempted


@pytest.mark.witness
@pytest.mark.slow
def test_examples_are_true(folder, monkeypatch):
    """All of the package, in one folder: what `identify` records and saves, others read."""
    monkeypatch.chdir(folder)
    paths = [p for p in sorted(PACKAGE.rglob("*.py")) if ">>> " in p.read_text(encoding="utf-8")]
    modules = [importlib.import_module(".".join(p.relative_to(ROOT).with_suffix("").parts)) for p in paths]
    found = {module.__name__: doctest.DocTestFinder(exclude_empty=True).find(module) for module in modules}
    tests = sorted(
        (test for each in found.values() for test in each if test.examples), key=lambda test: test.name != "rcsa_ident.front.verbs.identify"
    )
    assert tests[0].name == "rcsa_ident.front.verbs.identify"
    assert run(tests) > 300
    text = comment("MATERIALS")
    assert run([doctest.DocTestParser().get_doctest(text, {}, "MATERIALS", None, None)]) == 3


def test_every_public_name_has_an_example():
    for name in ri.__all__:
        document = comment(name) if name == "MATERIALS" else get_doc_object(getattr(ri, name))
        examples = document.partition("Examples\n--------\n")[2] if isinstance(document, str) else "\n".join(document["Examples"])
        assert ">>> " in examples, name
        assert "+SKIP" not in examples, name


def test_every_public_name_is_documented_as_the_house_does():
    assert set(ERROR_MSGS) >= NOT_ASKED
    errors = [(name, *error) for name in ri.__all__ if name != "MATERIALS" for error in validate(f"rcsa_ident.{name}")["errors"]]
    assert [each for each in errors if each[1] not in NOT_ASKED | ({"PR01"} if each[0] in CHOICES else set())] == []
