"""RESULT.json: what goes in comes out, what is broken is named."""

from __future__ import annotations

import copy
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcsa_ident.base.errors import InputError
from rcsa_ident.coupling.joint import LumpedJoint
from rcsa_ident.dynamics.coordinates import Dof, plane
from rcsa_ident.dynamics.modal import ModalModel
from rcsa_ident.io.results.parts import layout, plain, read_result, spindle_from_json, spindle_to_json, write_result

MODES = ModalModel(
    2 * np.pi * np.array([1285.2, 2400.0]),
    np.array([0.05, 1.0]),
    np.array([[1e-3 - 1e-3j, 1e-2 - 1e-2j], [2e-4 - 3e-4j, 0.1j]]),
    np.array([[1e-10, 2e-9], [2e-9, 3e-7]]),
    plane("flange", Dof.X),
)
JOINT = LumpedJoint(3e9, 6e6, 2000.0, 10.0)


@pytest.fixture
def result() -> dict:
    axis = spindle_to_json(MODES, JOINT) | {
        "covariance": {"parameters": ["a", "b"], "matrix": np.array([[1.0, 0.5], [0.5, 2.0]])},
        "misfit": {"chi2_per_point": np.float64(1.1), "per_tooling": {"S1-ER32": 1.0}},
    }
    return {
        "schema_version": 1, "status": "suspect", "reasons": ["few cuts"], "seed": 1, "method": "default", "software": "rcsa-ident 0.1.0",
        "campaign": {"name": "HPM", "cuts_used": 79, "cuts_left_out": [{"id": "S1-00", "reason": "chatter"}]},
        "sensors": {"flange_x": {"quantity": "displacement", "axis": "X", "sensitivity": 1e4}, "trigger": {"quantity": "trigger"}},
        "workpiece": {"name": "EN AW-6082", "tangential_coefficient_mpa": 902.0, "radial_ratio": 0.26},
        "band_hz": (450.0, 4300.0),
        "axes": {"X": axis},
        "delays": {"S1-01": {"angle_deg": 12.3, "std_deg": 0.2}},
        "later": {"keys": [None, True]},
    }  # fmt: skip


def test_a_result_comes_back(tmp_path, result):
    path = tmp_path / "RESULT.json"
    write_result(path, result)
    read = read_result(path)
    assert read["axes"]["X"]["covariance"]["matrix"] == [[1.0, 0.5], [0.5, 2.0]]
    assert read["later"] == {"keys": [None, True]}
    modes, joint = spindle_from_json(read["axes"]["X"], Dof.X, str(path))
    assert joint == JOINT
    assert modes.coordinates == plane("flange", Dof.X)
    np.testing.assert_allclose(modes.omega_n, MODES.omega_n, rtol=4e-16)
    np.testing.assert_array_equal(modes.phi, MODES.phi)
    np.testing.assert_array_equal(modes.residual, MODES.residual)
    write_result(tmp_path / "again.json", read)
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert max(map(len, path.read_text().splitlines())) <= 160


finite = st.floats(-1e12, 1e12)


@settings(max_examples=50, deadline=None)
@given(
    modes=st.lists(st.tuples(st.floats(1e-3, 1e6), st.floats(1e-6, 1.0), finite, finite, finite, finite), min_size=1, max_size=5),
    residual=st.tuples(finite, finite, finite),
    joint=st.tuples(*[st.floats(1e-6, 1e15)] * 4),
    axis=st.sampled_from([Dof.X, Dof.Y]),
)
def test_spindle_round_trip(modes, residual, joint, axis):
    table = np.array(modes)
    phi = np.stack([table[:, 2] + 1j * table[:, 3], table[:, 4] + 1j * table[:, 5]], axis=1)
    a, b, c = residual
    model = ModalModel(table[:, 0], table[:, 1], phi, np.array([[a, b], [b, c]]), plane("flange", axis))
    data = json.loads(layout(spindle_to_json(model, LumpedJoint(*joint))))
    back, back_joint = spindle_from_json(data, axis, "here")
    assert back_joint == LumpedJoint(*joint)
    np.testing.assert_allclose(back.omega_n, model.omega_n, rtol=1e-15)
    np.testing.assert_array_equal(back.zeta, model.zeta)
    np.testing.assert_array_equal(back.phi, model.phi)
    np.testing.assert_array_equal(back.residual, model.residual)
    assert back.coordinates == model.coordinates


json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=30,
)


@settings(max_examples=100, deadline=None)
@given(json_values)
def test_layout_changes_no_value(value):
    assert json.loads(layout(value)) == value


def put(data: dict, path: str, value: object) -> dict:
    data = copy.deepcopy(data)
    *way, last = [int(key) if key.isdigit() else key for key in path.split("/")]
    inner: object = data
    for key in way:
        inner = inner[key]  # type: ignore[index]
    if value is None:
        del inner[last]  # type: ignore[attr-defined]
    else:
        inner[last] = value  # type: ignore[index]
    return data


BROKEN = [
    ("schema_version", 2, ["schema_version", "found 2", "allowed is 1"]),
    ("schema_version", None, ["schema_version", "found nothing"]),
    ("status", "done", ["status", '"done"', "converged, not validated, suspect, failed"]),
    ("reasons", "none", ["reasons", "a list of texts"]),
    ("seed", -1, ["seed", "found -1", "a whole number at least 0"]),
    ("method", None, ["method", "found nothing"]),
    ("campaign/cuts_used", 1.5, ["campaign.cuts_used", "a whole number"]),
    ("campaign/cuts_left_out", {}, ["campaign.cuts_left_out", "an empty table"]),
    ("campaign/cuts_left_out/0/reason", None, ["campaign.cuts_left_out[0].reason", "found nothing"]),
    ("sensors/flange_x/axis", "x", ["sensors.flange_x.axis", "one of X, Y"]),
    ("workpiece/radial_ratio", "0.26", ["workpiece.radial_ratio", 'the text "0.26"']),
    ("band_hz", [4300.0, 450.0], ["band_hz", "lower < upper"]),
    ("band_hz", [450.0], ["band_hz", "a list of 1", "2 finite numbers"]),
    ("axes", {}, ["axes", "an empty table"]),
    ("axes/Z", {}, ["axes", "found Z", "X, Y or both"]),
    ("axes/X/modes", [], ["axes.X.modes", "an empty list"]),
    ("axes/X/modes/1/damping_ratio", 1.5, ["axes.X.modes[1].damping_ratio", "found 1.5", "at most 1"]),
    ("axes/X/modes/1/phi_r", [1.0], ["axes.X.modes[1].phi_r", "a list of 1"]),
    ("axes/X/modes/0/natural_frequency_hz", 0, ["axes.X.modes[0].natural_frequency_hz", "above 0 [Hz]"]),
    ("axes/X/residual_compliance", [[0.0, 0.0]], ["axes.X.residual_compliance", "2 rows of 2"]),
    ("axes/X/residual_compliance/1/0", "0", ["axes.X.residual_compliance[1][0]", 'the text "0"']),
    ("axes/X/joint/translational_stiffness", 0.0, ["axes.X.joint.translational_stiffness", "above 0"]),
    ("axes/X/joint", None, ["axes.X.joint", "found nothing", "a table"]),
    ("axes/X/covariance/parameters", ["a"], ["axes.X.covariance.matrix", "a list of 2", "1 rows of 1"]),
    ("axes/X/covariance/matrix", [[1.0, 0.5], [0.4, 2.0]], ["axes.X.covariance.matrix", "not symmetric"]),
    ("axes/X/covariance/matrix", [[-1.0, 0.5], [0.5, 2.0]], ["axes.X.covariance.matrix", "a variance below 0"]),
    ("axes/X/misfit/chi2_per_point", True, ["axes.X.misfit.chi2_per_point", "found true"]),
    ("delays/S1-01/std_deg", -0.1, ["delays.S1-01.std_deg", "at least 0"]),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value", "words"), BROKEN, ids=[f"{i}-{k}" for i, (k, _, _) in enumerate(BROKEN)])
def test_a_bad_result_is_neither_read_nor_written(tmp_path, result, key, value, words):
    path = tmp_path / "RESULT.json"
    write_result(path, result)
    good = path.read_bytes()
    broken = put(json.loads(good), key, value)
    with pytest.raises(InputError):
        write_result(path, broken)
    assert path.read_bytes() == good
    path.write_text(json.dumps(broken))
    with pytest.raises(InputError) as error:
        read_result(path)
    for word in [str(path), *words]:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{\n"a": 1,\n}', ["line", "a JSON error"]),
        ("[1]", ["content", "a list of 1", "a table of keys"]),
        ('{"seed": NaN}', ["found NaN", "finite numbers"]),
        ('{"seed": 1e999}', ["found 1e999", "finite numbers"]),
        ('{"seed": 1, "seed": 2}', ["seed", "the same key twice"]),
        ("[" * 100_000, ["lists nested too deeply"]),
        ('{"seed": 1' + "0" * 5000 + "}", ["a JSON error"]),
        ('{"a": "\udcff"}', ["bytes that are not text"]),
        ("", ["an empty file"]),
    ],
)
def test_a_file_that_is_no_result(tmp_path, text, words):
    path = tmp_path / "RESULT.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError) as error:
        read_result(path)
    for word in [str(path), *words]:
        assert word in str(error.value)


def test_a_failed_result_needs_no_axes(tmp_path, result):
    write_result(tmp_path / "r.json", result | {"status": "failed", "axes": {}})
    assert read_result(tmp_path / "r.json")["status"] == "failed"


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"a": [1.0, {"b": math.nan}]}, r"a\[1\]\.b: found nan"),
        ({"a": np.array([[1.0, np.inf]])}, r"a\[0\]\[1\]: found inf"),
        ({"a": 1j}, "a: found a complex"),
        (math.inf, "value: found inf"),
    ],
)
def test_what_json_cannot_hold_is_named(data, words):
    with pytest.raises(InputError, match=words):
        plain(data)


def test_a_result_that_json_cannot_hold_leaves_no_file(tmp_path, result):
    with pytest.raises(InputError, match="found nan"):
        write_result(tmp_path / "r.json", result | {"more": math.nan})
    assert list(tmp_path.iterdir()) == []


def test_only_a_bending_plane_is_written():
    model = ModalModel([1.0], [0.1], [[1.0]], [[0.0]], plane("flange")[:1])
    with pytest.raises(InputError, match="translation and slope"):
        spindle_to_json(model, JOINT)
