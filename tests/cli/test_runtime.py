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


MAPS = """
import mmap
import jax
from dbvfiv.runtime import free_memory

double = jax.jit(lambda x: 2 * x)
double(1.0)
free_memory()
kept = double._cache_size()
granted = int(open("/proc/sys/vm/max_map_count").read())
# neighbours of other rights are maps of their own
pages = [mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE * (i % 2)) for i in range(granted // 2)]
free_memory()
print(kept, double._cache_size(), float(double(2.0)))
"""


@pytest.mark.skipif(not os.path.exists("/proc/sys/vm/max_map_count"), reason="Linux grants maps, others do not count")
def test_programs_are_dropped_before_memory_maps_run_out():
    assert subprocess.check_output([sys.executable, "-c", MAPS], text=True).split() == ["1", "0", "4.0"]
