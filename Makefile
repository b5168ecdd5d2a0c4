# Two commands matter, `make demo` and `make test`; each sets up what is missing first.
PYTHON = $(shell cat build/setup/python 2>/dev/null)
JOBS ?= 2
CORE = tests --ignore=tests/cfd --ignore=tests/exchange

.PHONY: setup test verify random verify-3d bench demo demo-full reproduce docs clean
.DEFAULT_GOAL := demo

setup:
	@tools/setup

# without these JAX, of the version in tools/constraints.txt, compiles in two thirds of the time what runs as fast
XLA_FLAGS ?= --xla_cpu_use_fusion_emitters=false
export XLA_FLAGS
# each program runs a few times only in tests: less is spent on making it fast
test: XLA_FLAGS += --xla_backend_optimization_level=0
# and all of them are kept: tests make many small ones again and again
test: export JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS ?= 0
# modules too, of which each worker, and each command that a test starts, imports hundreds
test: export PYTHONDONTWRITEBYTECODE =
test: setup
	@$(PYTHON) -m pytest -n $(JOBS) --dist loadscope -m "not slow"

# all that is slow but the random sets and the third dimension, with the tables that its tests print
verify: setup
	@$(PYTHON) -m pytest -n $(JOBS) --dist worksteal -rP -m "slow and not random" $(CORE)

# the random sets: one outcome and one count at thousands of states, and what `make verify` has samples of
random: setup
	@$(PYTHON) -m pytest -n $(JOBS) --dist worksteal -m random $(CORE)

# flow and wall in three dimensions, end to end; installs Debian's OpenFOAM where there is none
verify-3d: setup
	@tools/openfoam
	@$(PYTHON) -m pytest -s tests/cfd tests/exchange tests/verification/test_solid_wall.py

bench: setup
	@$(PYTHON) -m benchmarks

demo: setup
	@$(PYTHON) -m dbvfiv report cases/dbv12.toml --set report.heads="2 kPa:18 kPa:4" --set uncertainty.samples=64 --workers $(JOBS) -o out/demo/dbv12.html
	@echo "The valve in the browser: $(PYTHON) -m dbvfiv app cases/dbv12.toml"

demo-full: setup
	@PYTHON="$(PYTHON)" tools/demo

reproduce: setup
	@$(PYTHON) -m dbvfiv reproduce -o out/thesis

docs: setup
	@mkdir -p build
	@$(PYTHON) -m dbvfiv.studies.case > build/made && mv build/made docs/case-reference.md
	@$(PYTHON) -m dbvfiv.studies.case thesis > build/made && mv build/made cases/dbv12.toml
	@$(PYTHON) -m mkdocs build --strict --quiet
	@echo "The manual is in build/site/index.html."

clean:
	rm -rf out build
