"""A column that no reader asks for is named, whatever the table."""

from __future__ import annotations

import pytest

from rcsa_ident.io.curves.flanges import flange_machine_of, read_flange_machine
from rcsa_ident.io.curves.forces import read_forces_csv
from rcsa_ident.io.curves.frf_files import read_frfs
from rcsa_ident.io.paths.path_forces import read_path_forces
from rcsa_ident.io.paths.tool_paths import read_tool_path, tool_path_of
from rcsa_ident.io.recordings.robot_records import read_joint_record
from rcsa_ident.io.settings.engagements import read_engagement_map
from rcsa_ident.io.settings.postures import read_postures
from rcsa_ident.io.settings.robots import read_robot
from rcsa_ident.io.settings.spindle_drives import read_spindle_drive
from rcsa_ident.io.settings.tested_cuts import read_candidates, read_tested_cuts
from rcsa_ident.io.unread_columns import left_aside, reading_tables
from tests.fixtures.paths import ROOT

EXAMPLES = ROOT / "docs" / "formats" / "examples"
READERS = {
    "CUTS.csv": read_tested_cuts,
    "MAP.csv": read_engagement_map,
    "SPINDLE.csv": read_spindle_drive,
    "FLANGE.csv": read_flange_machine,
    "FORCES.csv": read_forces_csv,
    "FORCES_along_path.csv": lambda path: read_path_forces(path, read_tool_path(EXAMPLES / "PATH.csv")),
    "PATH.csv": read_tool_path,
    "MOTION.csv": read_joint_record,
    "POSTURES.csv": lambda path: read_postures(path, read_robot(EXAMPLES / "ROBOT.toml")),
}


def annotated(name: str) -> str:
    """An example with a column more."""
    comments = [line for line in (EXAMPLES / name).read_text().splitlines() if line.startswith("#")]
    header, *rows = (EXAMPLES / name).read_text().splitlines()[len(comments) :]
    return "\n".join([*comments, f"{header},note", *(f"{row},7" for row in rows)])


@pytest.mark.parametrize("name", READERS)
def test_a_column_that_nobody_reads_is_named(tmp_path, name):
    path = tmp_path / name
    path.write_text(annotated(name))
    with reading_tables():
        READERS[name](EXAMPLES / name)
        assert left_aside() == []
        READERS[name](path)
        READERS[name](path)
        assert left_aside() == [f"{path}: the column note is left aside"]
        assert left_aside() == []


def test_several_columns_are_one_sentence():
    with reading_tables():
        read_candidates(EXAMPLES / "CUTS.csv")
        (sentence,) = left_aside()
    assert sentence.endswith("CUTS.csv: the columns verdict, chatter_frequency_hz are left aside")


def test_paths_flanges_and_frfs_say_it_among_their_own_remarks(tmp_path):
    """The service reads texts."""
    assert "the column note is left aside" in flange_machine_of(annotated("FLANGE.csv")).remarks
    assert list(tool_path_of(annotated("PATH.csv"), "").remarks) == ["the column note is left aside"]
    (tmp_path / "FRF.csv").write_text(annotated("FRF.csv"))
    found = read_frfs(tmp_path / "FRF.csv")
    assert all(any("not read" in remark and "note" in remark for remark in each.remarks) for each in found)
