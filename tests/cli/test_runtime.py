"""What is set before any library is loaded."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from dbvfiv.runtime import blas_core

WIDE = "avx512f avx512dq avx512cd avx512bw avx512vl"


@pytest.mark.parametrize(
    ("flags", "core"),
    [(f"fpu avx2 fma {WIDE}", "SkylakeX"), ("avx avx2 fma avx512f", "Haswell"), ("avx2", None), ("sse2", None)],
)
def test_kernels_by_instructions(flags, core):
    assert blas_core(f"processor\t: 0\nmodel name\t: some\nflags\t\t: {flags}\nbugs\t: avx2 fma\n") == core


def test_a_processor_that_is_described_in_another_way():
    assert blas_core("") is None and blas_core("Features : fp asimd\n") is None


@pytest.mark.skipif(os.environ.get("NPY_DISABLE_CPU_FEATURES") != "FMA3", reason="numpy was built for one processor")
def test_products_of_complex_numbers_do_not_hang_on_where_they_lie():
    memory, numbers = np.zeros(64, complex), np.random.default_rng(0).standard_normal(14).view(complex)
    products = set()
    for first in range(7, 57):
        memory[:7], memory[first : first + 7] = numbers, numbers[::-1]
        products.add((memory[:7] * memory[first : first + 7]).tobytes())
        products.add(np.multiply(memory[:7], memory[first : first + 7], out=memory[:7]).tobytes())
    assert len(products) == 1


def test_what_the_user_has_set_stays():
    asked = os.environ | {"OPENBLAS_CORETYPE": "Nehalem"}
    code = "import os, dbvfiv; print(os.environ['OPENBLAS_CORETYPE'])"
    assert subprocess.check_output([sys.executable, "-c", code], env=asked, text=True).strip() == "Nehalem"
