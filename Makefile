# What a developer runs: `make help`. Needs Python with venv, a C compiler and Rust; the rest is installed in .venv.

PYTHON ?= python3
BIN = .venv/bin
# Some containers turn the cache of compiled modules off, and each process would compile numpy and scipy again.
unexport PYTHONDONTWRITEBYTECODE
# cargo and maturin use the same interpreter, so they share builds.
export PYO3_PYTHON = $(CURDIR)/$(BIN)/python
# uv installs in a fifth of pip's time. Without it, or where only pip's settings lead to an index, pip installs.
install = $(BIN)/uv pip install --quiet --python $(1) $(2) 2>/dev/null || \
	$(BIN)/pip --quiet --disable-pip-version-check --python $(1) install --no-compile $(2)

# What `make test` runs, two at a time, quick ones first. After a failure no further check starts.
CHECKS = layout tests-rust tests-python levels lint-rust types benches-python wheel-check
WORKERS = $(shell $(PYTHON) -c "import os; print((3 * os.cpu_count() + 1) // 2)")
# Tests that detect a wrong sum, for the instruction sets below the machine's.
KERNELS = numeric:: paths:: scattering:: synthesis::
OF_LEVELS = $(addprefix tests/boundary/test_core_,extremes.py receive.py threads.py) \
	$(addprefix tests/simulate/test_,closed_forms.py exact_surfaces.py beat.py synthesis.py)

.PHONY: help demo test $(CHECKS) wheel wheels bench docs notebooks format requirements clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1	\2/p' Makefile | expand -t 20
demo: $(if $(wildcard .venv/built),.venv/built,.venv/native) ## build, simulate the experiment and compare it with the truth: out/demo
	$(BIN)/radarcore demo --overwrite
test: ## format, lint, types, Rust and Python tests, benches once, the wheel
	@PYTHON=$(PYTHON) sh .ci/missing fmt clippy
	@$(MAKE) --no-print-directory --jobs=2 $(if $(filter output-sync,$(.FEATURES)),--output-sync=line) $(CHECKS)

layout: .venv/test
	cargo fmt --check
	$(BIN)/ruff format --quiet --check . && $(BIN)/ruff check --quiet .
# Unit tests trace rays and need an optimised core; the others and tiny benches are built quickly.
tests-rust: .venv/created
	cargo test --quiet --locked --lib
	cargo test --quiet --locked --profile dev --test '*' --benches -- --test
	cargo test --quiet --locked --profile dev --doc
lint-rust: .venv/created | tests-rust
	cargo clippy --quiet --lib --tests --benches --locked --features python -- -D warnings
# More workers than cores, as tests of sensors and servers mostly wait. Modules are compiled once before the workers start.
tests-python: .venv/test .venv/built
	@[ -d tests/__pycache__ ] || $(BIN)/python -m pytest --collect-only --quiet >/dev/null 2>&1 || true
	$(BIN)/python -m pytest --quiet --numprocesses=$(WORKERS) --dist=worksteal
levels: .venv/test .venv/built | tests-rust tests-python
	set -e; for level in $$($(BIN)/python -c "from radarcore import _core; print(*_core.levels()[:-1])"); do \
		export RADARCORE_SIMD=$$level; cargo test --quiet --locked --lib -- $(KERNELS) --skip every_level; \
		$(BIN)/python -m pytest --quiet --numprocesses=$(WORKERS) $(OF_LEVELS); done
# The stub of the core is compared without the package around it, which mypy has checked by then.
types: .venv/test .venv/built
	$(BIN)/mypy --no-error-summary
	@set -e; stub=$$(mktemp -d); trap 'rm -rf "$$stub"' EXIT; mkdir $$stub/radarcore; : > $$stub/radarcore/__init__.pyi; \
	cp python/radarcore/_core.pyi $$stub/radarcore; MYPYPATH=$$stub $(BIN)/python -m mypy.stubtest --concise radarcore._core
	@known=$$(PATH="$(CURDIR)/$(BIN):$$PATH" basedpyright --verifytypes radarcore --ignoreexternal) || { echo "$$known"; exit 1; }
benches-python: .venv/test .venv/built | tests-rust
	$(BIN)/python tests/benches_once.py
# In an empty environment with its required packages only, away from the sources.
wheel-check: wheel
	$(PYTHON) tests/wheel_contents.py dist/*.whl
	@set -e; empty=$$(mktemp -d); trap 'rm -rf "$$empty"' EXIT; $(PYTHON) -m venv --without-pip "$$empty"; \
	$(call install,"$$empty/bin/python",--constraint requirements/demo.txt dist/*.whl); \
	"$$empty/bin/python" tests/wheel_smoke.py

wheel: .venv/demo | .venv/built ## dist/*.whl for this machine
	@rm -f dist/radarcore-*.whl
	$(BIN)/maturin build --quiet --release --locked --out dist
wheels: .venv/wheels ## wheels for Linux systems old and new, as a release has them: TARGETS="..."
	PATH="$(CURDIR)/$(BIN):$$PATH" sh .ci/wheels $(TARGETS)
bench: .venv/bench .venv/built ## measure speed
	cargo bench --locked
	set -e; for bench in benches/*.py; do $(BIN)/python $$bench; done
docs: .venv/test ## the site: out/site
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
notebooks: .venv/test .venv/built ## run the tutorials and renew their outputs on the site
	$(BIN)/python docs/site/notebooks.py
format: .venv/test ## lay out the sources
	cargo fmt
	$(BIN)/ruff check --quiet --select I --fix .
	$(BIN)/ruff format .
requirements: .venv/created ## pin the packages of pyproject.toml: UPGRADE=--upgrade
	PATH="$(CURDIR)/$(BIN):$$PATH" sh requirements/compile.sh $(UPGRADE)
clean: ## remove what was built, and the environment
	rm -rf .venv dist build out/demo out/site target .mypy_cache .pytest_cache .ruff_cache python/radarcore/_core*.so

# The environment: files that mark finished steps.
.venv/created: requirements/uv.txt
	@PYTHON=$(PYTHON) sh .ci/missing && rm -rf .venv && $(PYTHON) -m venv .venv
	@$(BIN)/pip install --quiet --disable-pip-version-check --no-compile --only-binary :all: -r $< 2>/dev/null || true
	@touch $@
.venv/test .venv/wheels: .venv/demo
.venv/bench: .venv/test
.venv/demo .venv/test .venv/bench .venv/wheels: .venv/%: requirements/%.txt .venv/created
	@echo "-- packages: $<"; $(call install,$(PYO3_PYTHON),--no-deps -r $<)
	@touch $@
# For a demo alone, kernels for this processor only: half a minute less.
.venv/native .venv/built: Cargo.toml Cargo.lock pyproject.toml $(shell find rust -name '*.rs') .venv/demo
	@echo "-- Rust core (one or two minutes the first time)"
	@PIP_QUIET=1 $(BIN)/maturin develop --quiet --release --locked --features python \
		$$([ ! -x $(BIN)/uv ] || echo --uv) $(if $(filter %native,$@),--features native)
	@touch $@
