# Everything a developer runs; `make help` lists it. Needs Python, a C compiler and Rust, nothing else installed.

PYTHON ?= python3
VENV = .venv
BIN = $(VENV)/bin
# Some containers disable the cache of compiled modules. Then each of the many processes of the checks would compile numpy
# and scipy again.
unexport PYTHONDONTWRITEBYTECODE
INSTALL = $(BIN)/python requirements/install.py
INSTALL_HERE = $(INSTALL) $(BIN)/python

# Hide the notice about the successor of mkdocs.
MKDOCS = NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs

# cargo and maturin use the same interpreter, so they share builds.
export PYO3_PYTHON = $(CURDIR)/$(BIN)/python

WORKERS = $(shell $(PYTHON) -c "import os; print((3 * os.cpu_count() + 1) // 2)")

# What `make test` runs.
CHECKS = layout lint-python tests-rust tests-python levels lint-rust types benches-python wheel-check

# Kernel tests, and the Python tests that detect a wrong sum, for the instruction sets below the machine's.
KERNELS = numeric:: paths:: scattering:: synthesis::
OF_LEVELS = $(addprefix tests/boundary/test_core_,extremes.py receive.py threads.py) \
	$(addprefix tests/simulate/test_,closed_forms.py exact_surfaces.py beat.py synthesis.py)

# Older versions of make cannot separate the outputs of two commands.
IN_PIECES = $(if $(filter output-sync,$(.FEATURES)),--output-sync=line)

SOURCES = Cargo.toml Cargo.lock pyproject.toml $(shell find rust -name '*.rs')

# Linux wheels of a release: both processors, glibc and musl (Alpine). Targets known to rustup are built, or the given
# ones: make wheels TARGETS=aarch64-unknown-linux-gnu
LINUX = x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu x86_64-unknown-linux-musl aarch64-unknown-linux-musl
TARGETS = $(filter $(LINUX),$(shell rustup target list --installed))

.PHONY: help demo test $(CHECKS) wheel wheels bench docs docs-serve notebooks format clean tools checkers
.DELETE_ON_ERROR:

help:
	@echo "make demo     build and simulate the experiment and compare with the truth; results go to out/demo"
	@echo "make test     format, lint, types, Rust and Python tests, benches once tiny, wheel"
	@echo "make wheel    build dist/*.whl for this machine"
	@echo "make wheels   build wheels for Linux systems old and new, as a release has them"
	@echo "make bench    measure speed"
	@echo "make docs     build the site into out/site; make docs-serve shows it while pages are written"
	@echo "make notebooks run the tutorials into out/notebooks, and renew their outputs on the site"
	@echo "make format   lay out the Rust and Python sources"
	@echo "make clean    remove everything that was built, the environment included"

demo: $(VENV)/built
	$(BIN)/radarcore demo --overwrite

# Two checks at a time, quick ones first. A check prints its name at its start and its output in one piece at its end.
# After a failure no further check starts.
test: checkers
	@$(MAKE) --no-print-directory --jobs=2 $(IN_PIECES) $(CHECKS)

layout: $(VENV)/dev
	@echo "-- layout"
	@cargo fmt --check
	@$(BIN)/ruff format --quiet --check .

lint-python: $(VENV)/dev
	@echo "-- lint: Python"
	@$(BIN)/ruff check --quiet .

# After the tests, whose build would wait for it. With the boundary to Python, the only build with the lint of dead code.
lint-rust: $(VENV)/created | tests-rust
	@echo "-- lint: Rust"
	@cargo clippy --quiet --lib --tests --benches --locked --features python -- -D warnings

# Types of the package, and types seen by a user's checker. The stub of the core is compared with the core without the
# package around it, which would be checked twice.
types: $(VENV)/adapters $(VENV)/dataset $(VENV)/built
	@echo "-- types"
	@$(BIN)/mypy --no-error-summary
	@set -e; directory=$$(mktemp -d); trap 'rm -rf "$$directory"' EXIT; mkdir "$$directory/radarcore"; \
	cp python/radarcore/_core.pyi "$$directory/radarcore"; : > "$$directory/radarcore/__init__.pyi"; \
	MYPYPATH="$$directory" $(BIN)/python -m mypy.stubtest --concise radarcore._core
	@known=$$(PATH="$(CURDIR)/$(BIN):$$PATH" basedpyright --verifytypes radarcore --ignoreexternal) || { echo "$$known"; exit 1; }

# Unit tests trace rays and need an optimised core. The others, tiny benches included, use a quick unoptimised build.
tests-rust: $(VENV)/created
	@echo "-- tests and benches once: Rust"
	@cargo test --quiet --locked --lib
	@cargo test --quiet --locked --profile dev --test '*' --benches -- --test
	@cargo test --quiet --locked --profile dev --doc

# Most kernel tests loop over the levels themselves. The others and the user-level tests run again at each level below the
# highest, which all other checks use.
levels: $(VENV)/dev $(VENV)/built | tests-rust tests-python
	@set -e; levels=$$($(BIN)/python -c "from radarcore import _core; print(*_core.levels()[:-1])"); \
	for level in $$levels; do \
		echo "-- tests: kernels, at most $$level"; \
		RADARCORE_SIMD=$$level cargo test --quiet --locked --lib -- $(KERNELS) --skip every_level; \
		RADARCORE_SIMD=$$level $(BIN)/python -m pytest --quiet --numprocesses=$(WORKERS) $(OF_LEVELS); \
	done

# More workers than cores, as tests of sensors and servers mostly wait. Modules are compiled once before the workers start.
tests-python: $(VENV)/robots $(VENV)/adapters $(VENV)/dataset $(VENV)/docs $(VENV)/built
	@echo "-- tests: Python"
	@[ -d tests/__pycache__ ] || $(BIN)/python -m pytest --collect-only --quiet >/dev/null 2>&1 || true
	@$(BIN)/python -m pytest --quiet --numprocesses=$(WORKERS) --dist=worksteal

benches-python: $(VENV)/dev $(VENV)/dataset $(VENV)/built | tests-rust
	@echo "-- benches once: Python"
	@$(BIN)/python tests/benches_once.py

# Packs the build of the environment.
wheel: $(VENV)/demo | $(VENV)/built
	@echo "-- wheel"
	@rm -f dist/radarcore-*.whl
	@$(BIN)/maturin build --quiet --release --locked --out dist

# For older systems: zig links them with the C library of each. Without `rustup target add` only this machine's.
wheels: $(VENV)/wheels
	@rm -f dist/radarcore-*.whl
	@set -e; for target in $(TARGETS); do \
		case $$target in *-musl) oldest=musllinux_1_2 ;; *) oldest=manylinux_2_17 ;; esac; \
		echo "-- wheel: $$target, $$oldest"; \
		PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/maturin build --quiet --release --locked --zig --target $$target \
			--compatibility $$oldest --out dist; \
	done
	@$(BIN)/python tests/wheel_contents.py dist/*.whl

# The wheel in an empty environment with its required packages only, away from the sources.
wheel-check: wheel
	@echo "-- wheel in an empty environment"
	@$(PYTHON) tests/wheel_contents.py dist/*.whl
	@set -e; directory=$$(mktemp -d); trap 'rm -rf "$$directory"' EXIT; \
	$(PYTHON) -m venv --without-pip "$$directory"; \
	$(INSTALL) "$$directory/bin/python" --constraint requirements/demo.txt dist/*.whl; \
	"$$directory/bin/python" tests/wheel_smoke.py

bench: $(VENV)/bench $(VENV)/built
	cargo bench --locked
	@for bench in benches/*.py; do \
		[ ! -e "$$bench" ] || { echo "$$bench"; $(BIN)/python "$$bench"; } || exit 1; \
	done

# Without a network, and without the core: docstrings are read, not run.
docs: $(VENV)/docs
	@$(MKDOCS) build --strict
	@echo "see out/site/index.html"

docs-serve: $(VENV)/docs
	@$(MKDOCS) serve

notebooks: $(VENV)/docs $(VENV)/built
	@$(BIN)/python docs/site/notebooks.py

format: $(VENV)/dev
	cargo fmt
	$(BIN)/ruff check --quiet --select I --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) dist build out/demo out/site target .mypy_cache .pytest_cache .ruff_cache
	rm -f python/radarcore/_core*.so
	find python tests benches examples docs -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

# The environment. Each file below marks a finished step, which is repeated when its dependencies change.

# Without uv for the machine, pip installs all.
$(VENV)/created: requirements/uv.txt | tools
	@echo "-- environment in $(VENV)"
	@rm -rf $(VENV)
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --disable-pip-version-check --no-compile --only-binary :all: -r $< 2>/dev/null || true
	@touch $@

# Groups of packages, one file each. Those without dependencies list all packages they need.
GROUPS = demo dev bench robots adapters dataset docs wheels
COMPLETE = robots adapters dataset docs wheels

$(VENV)/dev $(VENV)/wheels: $(VENV)/demo
$(VENV)/bench $(VENV)/robots $(VENV)/adapters $(VENV)/dataset $(VENV)/docs: $(VENV)/dev

$(GROUPS:%=$(VENV)/%): $(VENV)/%: requirements/%.txt $(VENV)/created | tools
	@echo "-- packages: $<"
	@$(INSTALL_HERE) $(if $(filter $*,$(COMPLETE)),--no-deps) -r $<
	@touch $@

$(VENV)/built: $(SOURCES) $(VENV)/demo
	@echo "-- Rust core (two minutes the first time)"
	@PIP_QUIET=1 $(BIN)/maturin develop $$([ ! -x $(BIN)/uv ] || echo --uv) --quiet --release --locked
	@touch $@

# Rust tools for `make test` only.
checkers: tools
	@{ cargo fmt --version && cargo clippy --version; } >/dev/null 2>&1 || { \
		echo "rustfmt or clippy is missing: rustup component add rustfmt clippy"; exit 1; }

# Name everything that is missing at once.
tools:
	@ok=yes; \
	if ! $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
		ok=no; echo "Python 3.11 or newer is missing ($(PYTHON); another one: make PYTHON=python3.12 ...)"; \
		echo "    Debian: apt install python3 python3-venv   Fedora: dnf install python3   macOS: brew install python"; \
	elif ! $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null; then \
		ok=no; echo "Python's venv and pip are missing"; \
		echo "    Debian: apt install python3-venv   Fedora: dnf install python3-pip   macOS: brew install python"; \
	fi; \
	if ! command -v cc >/dev/null 2>&1; then \
		ok=no; echo "A C compiler (cc), which Rust links with, is missing"; \
		echo "    Debian: apt install gcc libc6-dev   Fedora: dnf install gcc   macOS: xcode-select --install"; \
	fi; \
	needed=$$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml); \
	found=$$(rustc --version 2>/dev/null | cut -d ' ' -f 2); \
	if ! command -v cargo >/dev/null 2>&1 || [ -z "$$found" ]; then \
		ok=no; echo "Rust $$needed or newer is missing (cargo, rustc)"; \
		if [ -x "$$HOME/.cargo/bin/cargo" ]; then echo "    it is installed but not in PATH: . ~/.cargo/env"; \
		else echo "    see https://rustup.rs"; fi; \
	elif [ "$$(printf '%s\n' "$$needed" "$$found" | sort -t . -k 1,1n -k 2,2n | head -n 1)" != "$$needed" ]; then \
		ok=no; echo "Rust $$needed or newer is needed, this is $$found: rustup update"; \
		echo "    not from rustup? see https://rustup.rs"; \
	fi; \
	[ $$ok = yes ]
