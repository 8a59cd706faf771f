"""What a change reaches, and that compiled kernels are kept under the hash of their text: what the rings of the tests rest on."""

from __future__ import annotations

import os

import pytest

from tests.fixtures import kept_kernels
from tests.fixtures.paths import ROOT
from tests.fixtures.reach import reached


@pytest.mark.parametrize(
    ("changed", "test", "reach"),
    [
        ("rcsa_ident/io/paths/gcode.py", "tests/io/paths/test_gcode.py", True),
        ("rcsa_ident/io/paths/gcode.py", "tests/dynamics/test_modal.py", False),
        # through others, and by names in strings
        ("rcsa_ident/dynamics/_kernels.py", "tests/stability/test_zero_order.py", True),
        ("rcsa_ident/io/recordings/parquet.py", "tests/cli/test_forces.py", True),
        ("rcsa_ident/stability/discretisation.py", "tests/api/test_tool_change.py", True),
        # a process imports what it likes
        ("rcsa_ident/version.py", "tests/front/test_names.py", True),
        ("api/tls.py", "tests/api/test_serve.py", True),
        ("tests/fixtures/by_hand.py", "tests/cli/test_lobes.py", True),
        ("tests/cli/conftest.py", "tests/cli/test_lobes.py", True),
        ("tests/cli/conftest.py", "tests/dynamics/test_modal.py", False),
        ("tests/cli/test_lobes.py", "tests/cli/test_forces.py", False),
        ("api/page/js/app.js", "tests/web/test_page.py", True),
        ("api/page/js/app.js", "tests/dynamics/test_modal.py", False),
        ("docs/lobes.md", "tests/docs/test_site.py", True),
        ("docs/lobes.md", "tests/stability/test_zero_order.py", False),
        ("docs/examples/kept.py", "tests/gallery/test_examples.py", True),
        ("data/machines/hpm.toml", "tests/dynamics/test_modal.py", True),
        ("pyproject.toml", "tests/dynamics/test_modal.py", True),
        ("rcsa_ident/dynamics/__init__.py", "tests/dynamics/test_modal.py", True),
    ],
)
def test_a_change_reaches(changed, test, reach):
    assert (ROOT / test).is_file()
    assert reached([changed], ROOT / test) is reach


def test_kernels_are_kept_by_their_text(tmp_path, monkeypatch):
    """Another checkout with the same text takes them, at any time of its file; another text does not, and loses those of the old one."""
    monkeypatch.setattr(kept_kernels, "KEPT", tmp_path / "kept")
    rooms = [tmp_path / name / "room" for name in ("first", "second")]
    for room in rooms:
        (room / "__pycache__").mkdir(parents=True)
        (room / "_kernels.py").write_text("x = 1\n")
    first, second = (room / "__pycache__" for room in rooms)
    assert not kept_kernels.restore(rooms[0].parent)
    (first / "_kernels.f-1.py311.nbi").write_bytes(b"index")
    (first / "_kernels.f-1.py311.1.nbc").write_bytes(b"code")
    kept_kernels.keep(rooms[0].parent)
    os.utime(rooms[1] / "_kernels.py", (5.0, 5.0))
    assert kept_kernels.restore(rooms[1].parent)
    assert (second / "_kernels.f-1.py311.1.nbc").read_bytes() == b"code"
    assert len({(room / "_kernels.py").stat().st_mtime for room in rooms}) == 1
    (rooms[1] / "_kernels.py").write_text("x = 2\n")
    (second / "_kernels.f-1.py311.2.nbc").write_bytes(b"code of the text before")
    kept_kernels.keep(rooms[1].parent)
    assert not kept_kernels.restore(rooms[1].parent)
    assert list(second.glob("*.nb[ci]")) == []
    assert kept_kernels.restore(rooms[0].parent)
    # a cache folder that cannot be written keeps nothing
    monkeypatch.setattr(kept_kernels, "KEPT", rooms[0] / "_kernels.py" / "kept")
    kept_kernels.keep(rooms[0].parent)
    monkeypatch.setenv("NUMBA_CPU_NAME", "another")
    assert not kept_kernels.restore(rooms[0].parent)
