"""What a job remembers comes back to the last bit, and nothing else comes out of it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from api.jobs import codec
from api.jobs.codec import NOUNS, Unknown, _noun, decode, encode
from api.work.requests import LobeRequest
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import ProcessDamping
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.coupled.fit import CoupledSearch
from rcsa_ident.identification.coupled.parameters import EVERY_PAIR, CoupledLayout
from rcsa_ident.identification.joint_fit import AxisSearch
from rcsa_ident.identification.parameters import AxisLayout, Layout
from rcsa_ident.identification.progress import Stage, Step
from rcsa_ident.machining_setup import CutSpec
from rcsa_ident.remarks import Remark
from rcsa_ident.signals.verdict import RecordCode, Verdict

DTYPES = st.sampled_from(["<f8", ">f8", "<c16", "<i8", "<i4", "<u2", "?", "<f4"])
ARRAYS = DTYPES.flatmap(lambda kind: arrays.arrays(kind, arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)))
REMARKS = st.builds(Remark, st.sampled_from(RecordCode), st.text())
LEAVES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.complex_numbers(),
    st.text(),
    st.sampled_from(list(Dof)),
    st.builds(AxisLayout, st.integers(1, 9), st.booleans(), st.booleans()),
    st.builds(Verdict, st.lists(REMARKS, max_size=2).map(tuple), st.just(())),
    ARRAYS,
    ARRAYS.map(lambda a: a.T),
    st.floats().map(np.float64),
    st.integers(-5, 5).map(np.int64),
)
NAMES = st.text() | st.sampled_from(Dof)


def _nested(inner):
    rows = st.lists(inner, max_size=4)
    return st.one_of(rows, rows.map(tuple), st.dictionaries(NAMES, inner, max_size=3))


VALUES = st.recursive(LEAVES, _nested, max_leaves=12)


def same(a, b) -> bool:
    """Same types, same bits, NaN included."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        flags = (a.flags.writeable == b.flags.writeable) and (a.ndim < 2 or a.size < 2 or not a.flags.f_contiguous or b.flags.f_contiguous)
        native = a.dtype.newbyteorder("=")
        return native == b.dtype and a.shape == b.shape and a.astype(native).tobytes() == b.tobytes() and flags
    if isinstance(a, np.generic):
        return a.tobytes() == b.tobytes()
    if isinstance(a, float):
        return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))
    if isinstance(a, complex):
        return same(a.real, b.real) and same(a.imag, b.imag)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, Remark):
        return a == b and a.code is b.code
    if is_dataclass(a):
        return all(same(getattr(a, field.name), getattr(b, field.name)) for field in fields(a))
    return a == b


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(VALUES)
def test_what_is_told_comes_back(value):
    text = encode(value)
    json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    back = decode(text)
    assert same(value, back)
    # what is told a second time is the same text: a job that was killed goes on from what an undisturbed one had
    assert encode(back) == text


def test_what_a_search_has_come_to():
    rng = np.random.default_rng(1)
    layout = Layout((AxisLayout(3, places=2), AxisLayout(2, softening=True)), 4, 1)
    turned = np.asfortranarray(rng.standard_normal((layout.size, layout.size)))
    candidate = Candidate(rng.standard_normal(layout.size), layout, rng.standard_normal((5, 2)), 1.0 / 3.0, turned)
    steps = [Step("x", Stage.SEARCH, np.inf, 5), Step("both", Stage.MODES, -1.0, 4)]
    value = AxisSearch([candidate, candidate], [-2.5, np.nan], 5e-4, np.ones(5), steps)
    assert same(value, decode(encode(value)))


@pytest.mark.parametrize("skew", [0, 2, EVERY_PAIR])
def test_what_a_search_of_both_planes_has_come_to(skew):
    """A killed job goes on from what its starts of both planes had found, to the last bit."""
    rng = np.random.default_rng(2)
    layout = CoupledLayout(4, fixture=True, softening=True, skew=skew, turning=-1, coefficients=3, clampings=2)
    candidate = Candidate(rng.standard_normal(layout.size), layout, rng.standard_normal((5, 2)), 0.1, rng.standard_normal((2, 2)))
    value = [CoupledSearch(candidate, -1.0 / 3.0, (0.003, 5e-4), np.array([1.0, 0.1]))]
    assert same(value, decode(encode(value)))


def test_a_question():
    cut = CutSpec(Engagement(0.5, 3.0), 0.25, None, "steel", {"tangential": 9.02e8}, (1e-6, 0.0), ProcessDamping(1e14, 1e-4, 0.3))
    question = LobeRequest(cut, (418.87902047863909, 500.0), 0.01, "semi-discretisation", True, 0.0005, 20.0)
    assert same(question, decode(encode(question)))


def test_every_known_noun_is_a_frozen_one_or_a_name_of_something():
    for place in NOUNS:
        noun = _noun(place.rpartition(".")[2])
        assert f"{noun.__module__}.{noun.__name__}" == place
        assert issubclass(noun, Enum | Remark) or noun.__dataclass_params__.frozen


@dataclass(frozen=True)
class Layout2:
    modes: int


class Float(float):
    pass


@pytest.mark.parametrize(
    "value",
    [
        object(),
        {1, 2},
        b"x",
        Layout2(1),
        lambda: None,
        Float(1.0),
        np.array([object()]),
        np.array(["x"]),
        np.array([0], "M8[s]"),
        type(None),
    ],
)
def test_nothing_else_is_told(value):
    with pytest.raises(Unknown):
        encode([value])


@pytest.mark.parametrize(
    "text",
    [
        "", "{", '{"a": 1}', '{"a": 1, "b": 2}', "{}", '{"~os.system": {"command": "x"}}', '{"~Popen": {}}',
        '{"~enum": ["Dof", "sideways"]}', '{"~enum": ["dict", 1]}', '{"~array": ["O", [1], "C", true, "AAAA"]}',
        '{"~array": ["<f8", [2], "C", true, "AAAA"]}', '{"~array": ["<f8", [1], "C", true, "!"]}',
        '{"~AxisLayout": {"modes": 1, "more": 2}}', '{"~AxisLayout": 3}', '{"~float": "x"}', "[" * 100_000,
        # nouns of an earlier version, whose places are gone or whose fields were others
        '{"~Residual": {"lines": {"~tuple": []}, "own": 1, "cuts": 2}}', '{"~AxisSearch": {"solutions": [], "evidences": []}}',
    ],
)  # fmt: skip
def test_nothing_else_comes_out(text):
    with pytest.raises(Unknown):
        decode(text)


def test_a_noun_whose_place_is_gone_is_unknown(monkeypatch):
    """Another version may have named a module that this one does not have."""
    for place in ("rcsa_ident.nowhere.Dof", "rcsa_ident.errors.Dof"):
        monkeypatch.setitem(codec._PLACES, "Dof", place)
        codec._noun.cache_clear()
        with pytest.raises(Unknown):
            decode('{"~enum": ["Dof", "x"]}')
    monkeypatch.undo()
    codec._noun.cache_clear()
    assert decode('{"~enum": ["Dof", "x"]}') is Dof.X
