"""The table of recommendations on roughly known machines counts by kind of tooling and knows that cases of one machine go together."""

from benchmarks.rough_recommendation import table


def row(machine, tooling, holds, share):
    return {"machine": machine, "cut": 0, "tooling": tooling, "recommended": {"holds": holds, "share": share}}


def test_the_interval_is_one_of_machines():
    # one of two machines fails always, as cases of one machine do: between them all and none may hold
    rows = [row(1, "first", True, 0.8)] * 20 + [row(2, "first", False, 1.1)] * 20 + [row(1, "different", True, 0.6)]
    rows.append({"machine": 1, "cut": 1, "tooling": "different", "recommended": None})
    cut, other, whole = table(rows).splitlines()[2:]
    assert cut == "| cut | 40 | 50.0 % (0 to 100 %) | 0.95 (0.80, 1.10) |"
    assert other == "| never cut, other holder | 1 | 100.0 % (100 to 100 %) | 0.60 (0.60, 0.60) |"
    assert whole.startswith("| all | 41 | 51.2 %")
