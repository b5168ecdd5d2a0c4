"""What is set before any library is loaded."""

from __future__ import annotations

import os
import subprocess
import sys

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


def test_what_the_user_has_set_stays():
    asked = os.environ | {"OPENBLAS_CORETYPE": "Nehalem"}
    code = "import os, dbvfiv; print(os.environ['OPENBLAS_CORETYPE'])"
    assert subprocess.check_output([sys.executable, "-c", code], env=asked, text=True).strip() == "Nehalem"
