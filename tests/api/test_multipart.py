"""A form is read alike however its body is cut, and to its very end or not at all."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest

from api.problems import Problem
from api.transfer import multipart
from api.transfer.multipart import Head, events

CONTENTS = [b"", b"a\r\n--", b"\r\n\r\n--x \r\n-" * 3, bytes(range(256))]


def part(head, content=b"", more=b""):
    return b"--xyz\r\nContent-Disposition: " + head + b"\r\n" + more + b"\r\n" + content + b"\r\n"


WHOLE = b"".join(part(b'form-data; name="f%d"; filename="c%d.h5"' % (k, k), each) for k, each in enumerate(CONTENTS)) + b"--xyz--"


@pytest.fixture
def read(monkeypatch):
    """What a body is read as that arrives in blocks of some bytes: each part with its content."""

    def parts(body, size=1 << 20):
        async def blocks(*_):
            for start in range(0, len(body), size):
                yield bytearray(body[start : start + size])

        async def found():
            request = SimpleNamespace(headers={"content-type": 'multipart/form-data; boundary="xyz"'})
            heads, contents, ended = [], [], 0
            async for event in events(request, None):
                if isinstance(event, Head):
                    heads.append(event)
                    contents.append(b"")
                elif event is None:
                    ended += 1
                else:
                    contents[-1] += event
            assert ended == len(heads)
            return list(zip(heads, contents, strict=True))

        monkeypatch.setattr(multipart, "blocks", blocks)
        return asyncio.run(found())

    return parts


@pytest.mark.parametrize("size", [1, 2, 3, 7, 50, len(WHOLE)])
@pytest.mark.parametrize("before", [b"", b"\r\n", b"what no one reads\r\n"])
@pytest.mark.parametrize("after", [b"", b"\r\n", b"\r\nwhat no one reads"])
def test_where_blocks_end_does_not_matter(read, size, before, after):
    told = [(Head(f"f{k}", f"c{k}.h5"), each) for k, each in enumerate(CONTENTS)]
    assert read(before + WHOLE + after, size) == told


def test_a_body_that_ends_early_is_none(read):
    for length in range(len(WHOLE)):
        with pytest.raises(Problem, match="not complete multipart/form-data") as error:
            read(WHOLE[:length])
        assert error.value.status == 400


@pytest.mark.parametrize(
    ("head", "field", "name"),
    [
        (b"form-data; name=query", "query", None),
        (b"form-data; name=f; filename=a.h5", "f", "a.h5"),
        ('form-data; name="f"; filename="Übergröße.h5"'.encode(), "f", "Übergröße.h5"),
        # one client's old encoding: its name is wrong, its neighbours are read
        ('form-data; name="f"; filename="Über.h5"'.encode("cp1252"), "f", "\ufffdber.h5"),
        (rb'form-data; name="f"; filename="C:\data\a.h5"', "f", "a.h5"),
        (b'form-data; name="f"; filename="../../a.h5"', "f", "a.h5"),
        # how browsers write a quotation mark, and how others do
        (b'form-data; name="f"; filename="2%22 tool.h5"', "f", '2" tool.h5'),
        (rb'form-data; name="f"; filename="2\" tool.h5"', "f", '2" tool.h5'),
        (b"form-data; filename=a.h5", "", "a.h5"),
        (b"form-data; name=f; filename*=utf-8''a.h5", "f", None),
    ],
)
def test_names(read, head, field, name):
    body = part(head, b"1") + part(b"form-data; name=next", b"2") + b"--xyz--"
    assert read(body) == [(Head(field, name), b"1"), (Head("next", None), b"2")]


@pytest.mark.parametrize(
    "body",
    [
        part(b"form-data; name=f", more=b"A: b\r\n" * 8),
        part(b"form-data; name=f", more=b"A: " + b"b" * 5000 + b"\r\n"),
        part(b"form-data; name=f", b"abc", more=b"Content-Length: 4\r\n"),
        part(b"attachment; name=f"),
        b"--xyz\r\n\r\nabc\r\n",
    ],
    ids=["9 headers", "header of 5 kB", "another length", "no form", "no disposition"],
)
def test_parts_that_are_refused(read, body):
    with pytest.raises(Problem, match="not complete multipart/form-data") as error:
        read(body + b"--xyz--")
    assert error.value.status == 400
    assert len(read(part(b"form-data; name=f", more=b"A: b\r\n" * 7) + b"--xyz--")) == 1
