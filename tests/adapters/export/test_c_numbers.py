"""Numbers in C: exact, and no longer than they must be."""

from ctypes import c_float

import pytest

from apollonius.adapters.export import c


@pytest.mark.parametrize("value", [0.0, -0.0, 1.0, -2.5, 0.1, 1e-40, 3.4e38, 2.0**-149])
def test_numbers_are_written_exactly(value):
    single = c_float(value).value
    text = c._exact(single)
    assert float.fromhex(text.removesuffix("f")) == single
    assert len(text) <= len("-0x1.123456p-126f")
