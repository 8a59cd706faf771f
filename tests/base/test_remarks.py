"""Sentences with codes."""

from __future__ import annotations

import copy
import json
import pickle

import pytest

from rcsa_ident.base.remarks import Remark, RemarkCode, says


class Code(RemarkCode):
    ONE = "one"
    TWO = "two"


def test_it_is_its_sentence_wherever_a_text_is_wanted():
    remark = Remark(Code.ONE, "no signal: x has the constant value 0")
    assert remark == "no signal: x has the constant value 0"
    assert json.dumps([remark, {remark: 1}]) == json.dumps([str(remark), {str(remark): 1}])
    assert f"{remark}" == "; ".join([remark]) == str(remark)
    assert type(str(remark)) is str


def test_the_code_goes_with_it():
    remark = Remark(Code.TWO, "words")
    for again in (pickle.loads(pickle.dumps(remark)), copy.deepcopy(remark), remark.of("air cut")):
        assert type(again) is Remark
        assert again.code is Code.TWO
    assert remark.of("air cut") == "air cut: words"
    with pytest.raises(AttributeError, match="frozen"):
        remark.code = Code.ONE


def test_whatever_the_words_are_the_code_decides():
    remarks = (Remark(Code.ONE, "one"), Remark(Code.ONE, "two"))
    assert says(remarks, Code.ONE)
    assert not says(remarks, Code.TWO)
    assert not says((), Code.ONE)
