"""What the mutation driver changes, and what it says of tests that notice and of those that do not."""

from __future__ import annotations

import ast

import pytest

from benchmarks import mutation

SOURCE = '''
"""Of no interest."""
LIMIT = 3


def inside(x, low=0.0):
    """Whether x lies between."""
    return low <= x and not x > LIMIT + 1


class Noun:
    def doubled(self):
        return max(2 * self.x, 0)
'''


def test_every_operator_comparison_and_number_changes_once():
    found = [(each.function, each.before, each.after) for each in mutation.mutants(SOURCE)]
    assert len(found) == len(set(found))
    for expected in (
        ("", "3", "4"),
        ("inside", "low <= x", "low < x"),
        ("inside", "low <= x", "low > x"),
        ("inside", "x > LIMIT + 1", "x >= LIMIT + 1"),
        ("inside", "LIMIT + 1", "LIMIT - 1"),
        ("inside", "not x > LIMIT + 1", "not not x > LIMIT + 1"),
        ("inside", "low <= x and (not x > LIMIT + 1)", "low <= x or not x > LIMIT + 1"),
        ("Noun.doubled", "max", "min"),
        ("Noun.doubled", "2 * self.x", "2 / self.x"),
    ):
        assert expected in found
    # neither defaults nor texts
    assert not any(before == "0.0" or "interest" in before for _, before, _ in found)


def test_a_mutant_is_a_whole_module():
    for each in mutation.mutants(SOURCE):
        names = {}
        exec(compile(each.tree(), "made", "exec"), names)
        assert callable(names["inside"])
        assert ast.unparse(each.tree()) != ast.unparse(ast.parse(SOURCE))


def test_tests_of_a_module():
    assert mutation.own_tests("rcsa_ident/machine/_kernels.py") == "tests/machine/test_kernels.py"
    assert mutation.own_tests("api/security.py") == "tests/api/test_security.py"


def test_what_is_told_as_equivalent_stands_in_its_module():
    """An expression that a module has no more would hide nothing, and say nothing."""
    known = mutation.equivalent()
    for module in {each["module"] for each in known}:
        source = (mutation.ROOT / module).read_text(encoding="utf-8")
        found = {(other.function, other.before, other.after) for other in mutation.mutants(source)}
        for each in known:
            places = {(name, each["before"], each["after"]) for name in each["functions"]}
            assert places, each
            assert each["module"] != module or places <= found, each
            assert each["why"]


@pytest.mark.slow
def test_a_mutant_that_tests_notice_is_killed(capsys, monkeypatch):
    killed, survivors, same, _ = mutation.score("rcsa_ident/base/units.py", ["tests/io/settings/test_spindle_drives.py"], 5, 1)
    assert killed + survivors + same == 5
    with pytest.raises(SystemExit, match="hold no test"):
        mutation.score("rcsa_ident/base/units.py", ["tests/oracles/analytic.py"], 1, 1)
