"""Decimal numbers of text against Python's own reading, to the last bit; these tests run again without the compiler."""

import numpy as np
import pytest

from rcsa_ident.io import _kernels

KERNELS = [_kernels.decimal_rows, getattr(_kernels.decimal_rows, "py_func", _kernels.decimal_rows)]


def rows(kernel, text, places, delimiter=",", point="."):
    raw = np.frombuffer(text.encode("latin-1"), np.uint8)
    values = np.full((text.count("\n"), max(places) + 1), 7.0)
    return kernel(raw, ord(delimiter), ord(point), np.array(places), values), values


@pytest.mark.parametrize("kernel", KERNELS)
def test_numbers_are_the_nearest_doubles(kernel):
    rng = np.random.default_rng(1)
    form = ["%.7g", "%.15g", "%.3f", "%+.8e", "%.14E", "%d"]
    drawn = rng.standard_normal((200, 6)) * 10.0 ** rng.integers(-3, 6, (200, 6))
    cells = [[each % value for each, value in zip(form, line, strict=True)] for line in drawn]
    cells += [
        ["0", "-0.0", "1.", ".5", "1e22", "9007199254740992"],
        ["007.50", "1e-22", "-1E+3", "0.1", "0000000000000000000000001", "1e0"],
    ]
    found, values = rows(kernel, "".join(f"{','.join(line)}\n" for line in cells), [0, 1, 2, 3, 4, 5])
    assert found == len(cells)
    expected = np.array([[float(cell) for cell in line] for line in cells])
    np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(np.signbit(values), np.signbit(expected))


@pytest.mark.parametrize("kernel", KERNELS)
def test_cells_that_are_empty_or_passed_over(kernel):
    found, values = rows(kernel, "1,5; ;12:00 x\t;-2\r\n ,25 ;3;;\n", [1, 0, -1, 2], ";", ",")
    assert found == 2
    np.testing.assert_array_equal(values, [[np.nan, 1.5, -2.0], [3.0, 0.25, np.nan]])


NOT_PLAIN = [
    "", "1", "1,2,3", "1,x", "1,2 3", "1,1_0", "1,nan", "1,inf", "1,--2", "1,-", "1,.", "1,1e", "1,1e+", "1,1.2.3", "1,9007199254740993",
    "1,0.12345678901234567", "1,1e23", "1,1e-23", "1,1e99999999999", "1,2\r\r", "1,\xb2", '1,"2"', "1,\t2",
    ",", " , ", "1,2\x00", "\x0b1,2",
]  # fmt: skip


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("line", NOT_PLAIN, ids=ascii)
def test_what_is_not_plain_is_left_to_others(kernel, line):
    assert rows(kernel, f"1,2\n{line}\n", [0, 1])[0] == -1


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("cell", ["\x0b", "\x85", "\x00", "a\rb", "é"], ids=ascii)
def test_what_would_end_a_line_elsewhere_is_seen_in_cells_that_are_passed_over(kernel, cell):
    assert rows(kernel, f"1,{cell},2\n", [0, -1, 1])[0] == -1
    assert rows(kernel, "1,a b#~,2\n", [0, -1, 1])[0] == 1


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("text", ["1:2,3\n", "1/2,3\n", "12:,3\n"])
def test_signs_beside_the_digits_are_none(kernel, text):
    """In ASCII a stroke stands in front of 0, a colon behind 9."""
    assert rows(kernel, text, [0, 1])[0] == -1


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_line_that_holds_blanks_alone_is_no_row(kernel):
    assert rows(kernel, " ,\n", [-1, 0])[0] == -1
    count, values = rows(kernel, "x,\n", [-1, 0])
    assert count == 1
    assert np.isnan(values[0, 0])


@pytest.mark.parametrize("kernel", KERNELS)
def test_powers_of_ten_that_are_not_exact_are_left_to_python(kernel):
    """10^22 is the largest that a double holds; a product with the next one may be rounded twice."""
    told = 0
    for exponent in (22, -22, 23, -23, 24):
        for whole in range(1, 400, 7):
            count, values = rows(kernel, f"{whole}e{exponent}\n", [0])
            if count == 1:
                told += 1
                assert values[0, 0] == float(f"{whole}e{exponent}")
    assert told
