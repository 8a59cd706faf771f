"""What a job remembers comes back to the last bit, and nothing else comes out of it."""

from __future__ import annotations

import importlib
import json
import math
import pkgutil
from abc import ABC
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import datetime
from enum import Enum, StrEnum
from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import api
import rcsa_ident
from api import codec
from api.codec import NOUNS, Unknown, _noun, decode, encode
from api.jobs import identification, lobes, paths
from api.work.requests import LobeRequest, MachineText, ToolingSource
from rcsa_ident.base.plausibility import PlausibilityCode
from rcsa_ident.base.remarks import Remark, RemarkCode
from rcsa_ident.cutting.conditions import Engagement
from rcsa_ident.cutting.process import ProcessDamping, SpeedVariation
from rcsa_ident.dynamics.coordinates import Dof
from rcsa_ident.identification.candidate import Candidate
from rcsa_ident.identification.coupled.fit import CoupledSearch
from rcsa_ident.identification.joint_fit import AxisSearch
from rcsa_ident.identification.progress import Stage, Step
from rcsa_ident.identification.result import IdentificationCode
from rcsa_ident.identification.task import Phase
from rcsa_ident.identification.unknowns import EVERY_PAIR, CoupledLayout, Layout, ModalBlock
from rcsa_ident.setup.cut import CutSpec
from rcsa_ident.signals.verdict import RecordCode, Verdict
from rcsa_ident.workflows.stream_forces import LiveObserver

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
    st.datetimes(timezones=st.none() | st.timezones()),
    st.builds(ModalBlock, st.integers(1, 9), st.booleans(), st.booleans()),
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
    layout = Layout((ModalBlock(3, places=2), ModalBlock(2, softening=True)), 4, 1)
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
    swing = SpeedVariation(0.1, 0.2)
    cut = CutSpec(Engagement(0.5, 3.0), 0.25, None, "steel", {"tangential": 9.02e8}, (1e-6, 0.0), ProcessDamping(1e14, 1e-4, 0.3), swing)
    question = LobeRequest(cut, (418.87902047863909, 500.0), 0.01, "semi-discretisation", True, 0.0005, 20.0)
    assert same(question, decode(encode(question)))


@cache
def classes():
    """All classes of both packages."""
    found = set()
    for package in (rcsa_ident, api):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if ".migrations." not in module.name:
                members = vars(importlib.import_module(module.name)).values()
                found |= {each for each in members if isinstance(each, type) and each.__module__.startswith(("rcsa_ident.", "api."))}
    return found


def below(base):
    """Those of them that derive from one, a protocol included."""
    return {each for each in classes() if base in each.__mro__[1:]}


def test_a_remark_of_every_code():
    codes = below(RemarkCode)
    assert codes >= {IdentificationCode, PlausibilityCode, RecordCode}
    # whoever names a code as one has the base of all codes
    assert codes == {each for each in below(StrEnum) if each.__name__.endswith("Code") and each is not RemarkCode}
    for code in (each for kind in codes for each in kind):
        remark = Remark(code, f"{code} in words")
        assert same([remark], decode(encode([remark])))


#: What is written without a noun. Of mappings and sequences those are that a question or an answer is made with; `Any` stands for JSON.
PLAIN = {
    NoneType,
    bool,
    int,
    float,
    complex,
    str,
    datetime,
    np.ndarray,
    list,
    tuple,
    dict,
    Mapping,
    Sequence,
    Any,
    Ellipsis,
    Union,
    UnionType,
}


def reached(kind: Any, seen: set[Any]) -> set[Any]:
    """All types that a value may hold, by the annotations of its class, of those below it and of their fields."""
    for part in get_args(kind):
        reached(part, seen)
    kind = get_origin(kind) or kind
    if kind not in seen and kind is not np.dtype:
        seen.add(kind)
        hints = get_type_hints(kind) if is_dataclass(kind) else {}
        inside = [hints[field.name] for field in fields(kind)] if hints else []
        for each in (*inside, *(below(kind) if kind in classes() else ())):
            reached(each, seen)
    return seen


def test_all_that_is_stored_or_handed_on_is_known():
    """Questions of lobes and paths, judged recordings, what every task of an identification comes to, and plans of streams."""
    tasks = {each for each in classes() if isinstance(getattr(each, "phase", None), Phase)}
    assert len(tasks) >= 8
    roots = [get_type_hints(task.run)["return"] for task in tasks]
    roots += [hint for function in (lobes.asked, paths.asked) for hint in get_type_hints(function).values()]
    roots += [get_type_hints(identification._readings)["return"]]
    found = set[Any]()
    for root in (*roots, LiveObserver):
        reached(root, found)
    assert {AxisSearch, CoupledSearch, Candidate, CutSpec, LobeRequest, Verdict} <= found
    values = {each for each in found - PLAIN if not (getattr(each, "_is_protocol", False) or issubclass(each, ABC))}
    assert values - {_noun(name) for name in NOUNS} == set()


def test_every_known_noun_is_a_frozen_one_or_a_name_of_something():
    for name, place in NOUNS.items():
        noun = _noun(name)
        assert f"{noun.__module__}.{noun.__name__}" == place
        assert issubclass(noun, Enum | Remark) or noun.__dataclass_params__.frozen


#: Under which jobs in databases hold their nouns since 0.2.0, whatever the classes are called now and wherever they are.
STORED = (
    "Dof", "Remark", "RecordCode", "Verdict", "AxisLines", "CutMeasurement", "Reading", "AxisLayout", "Layout", "Candidate",
    "CoupledSearch", "CoupledLayout", "Stage", "Step", "AxisSearch", "Engagement", "Block", "Stepover", "EngagementMap", "Immersion",
    "ProcessDamping", "MachineText", "CutSpec", "ToolingSource", "LobeRequest", "PathRequest",
)  # fmt: skip


def test_a_name_under_which_a_noun_was_stored_stays():
    assert set(STORED) - NOUNS.keys() == set()


def test_a_job_of_the_first_release_is_read():
    """As it waits in a database: a machine, its toolings and what is asked of them."""
    text = """{"~tuple":[{"~MachineText":{"digest":"d","text":"{}"}},
    {"~tuple":[{"~ToolingSource":{"name":"T1","text":"[cutter]","keys":null}}]},{"~LobeRequest":{"cut":{"~CutSpec":{"engagement":{"~Engagement":{"entry":0.5,"exit":3.0}},"feed_angle":0.25,"feed_per_tooth":null,
    "material":"steel","coefficients":{"~table":[["tangential",902000000.0]]},"runout":{"~tuple":[1e-06,0.0]},"damping":null}},
    "speeds":{"~tuple":[418.8790204786391]},"max_depth":0.01,"method":"zero-order","bands":true,"stiffness_spread":0.0005,
    "work_seconds":20.0,"recommend":true,"tested":{"~tuple":[]}}}]}"""
    machine, toolings, question = decode(text)
    cut = CutSpec(Engagement(0.5, 3.0), 0.25, None, "steel", {"tangential": 9.02e8}, (1e-6, 0.0))
    assert same(question, LobeRequest(cut, (418.8790204786391,), 0.01, "zero-order", True, 0.0005, 20.0))
    assert same((machine, toolings), (MachineText("d", "{}"), (ToolingSource("T1", "[cutter]"),)))


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
    for place in ("rcsa_ident.nowhere.Dof", "rcsa_ident.base.errors.Dof"):
        monkeypatch.setitem(NOUNS, "Dof", place)
        codec._noun.cache_clear()
        with pytest.raises(Unknown):
            decode('{"~enum": ["Dof", "x"]}')
    monkeypatch.undo()
    codec._noun.cache_clear()
    assert decode('{"~enum": ["Dof", "x"]}') is Dof.X
