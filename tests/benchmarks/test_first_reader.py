"""The tutorial's commands are found where a reader finds them."""

from __future__ import annotations

from benchmarks.first_reader import TUTORIAL, scripts, steps


def test_commands_and_files_of_the_tutorial_in_their_order():
    found = list(steps(TUTORIAL.read_text("utf-8")))
    text = "\n".join(step.text for step in found)
    places = [
        text.index(word) for word in ("pip install .", "teeth = 4", "rcsa-ident lobes --frf", "rcsa-ident identify", "rcsa-ident advise")
    ]
    assert places == sorted(places)
    # of the other tabs
    assert "rcsa-ident-serve" not in text
    assert "import rcsa_ident" not in text
    assert [step.section[:2] for step in found if step.kind == "toml"] == ["2.", "3."]


def test_a_section_is_a_script():
    page = "## A\n```sh\npython3 -m venv .venv\nrcsa-ident warm\n```\n## B\n```toml\nx = 1\n```\n```sh\nls\n```\n"
    (first, install), (second, use) = scripts(steps(page), "/usr/bin/python3.12", without_warm=True)
    assert (first, second) == ("A", "B")
    assert install == "set -euo pipefail\n/usr/bin/python3.12 -m venv .venv"
    assert use == "set -euo pipefail\n. .venv/bin/activate\ncat > TOOL.toml <<'END'\nx = 1\nEND\nls"
