# Verbs for people and for CI. `make test` is the whole check; it needs Rust, Python >= 3.11, gcc and make, nothing else.
PYTHON ?= python3
VENV := .venv
export PIP_DISABLE_PIP_VERSION_CHECK := 1
BIN := $(VENV)/bin
WHEELS := target/wheels
# One profile and one set of features for all that the check runs: the library and the crates that it depends on
# are built once, for the wheel and for Rust's tests. Kernels for AVX-512 are left out where
# the processor cannot run them (clippy reads them).
AVX512 := $(if $(shell grep -m1 -wo avx512vl /proc/cpuinfo 2>/dev/null),avx512)
CHECKED := --profile ci --no-default-features --features "cli reference $(AVX512)"
# Unit tests also look for overflow and failed assertions.
ASSERTED := --config profile.ci.package.jacoflow.opt-level=0 --config profile.ci.package.jacoflow.overflow-checks=true \
	--config profile.ci.package.jacoflow.debug-assertions=true

.PHONY: fuzz test checks of-rust of-python demo format clippy features rustdoc rust-test guide wheel packages install pytest stubtest typing examples develop docs compare readme ablation clean

# The compiler often leaves a core idle: what is only checked, in the development profile, whose folder cargo locks
# apart from that of the wheel, takes what the wheel and its tests leave. Each prints when it ends.
test: format $(BIN)/maturin
	@$(MAKE) --no-print-directory -j3 -Otarget of-rust of-python checks
	@echo "everything passed"

of-rust: wheel
	@$(MAKE) --no-print-directory rust-test

of-python: wheel packages
	@$(MAKE) --no-print-directory -o wheel -o packages install
	@for step in pytest stubtest examples; do $(MAKE) --no-print-directory -o install $$step || exit 1; done

checks: packages
	@for step in typing clippy features guide rustdoc; do \
		CARGO_INCREMENTAL=0 nice $(MAKE) --no-print-directory -o packages $$step || exit 1; done

# The main job on an embedded example.
demo:
	cargo run -- demo

format:
	cargo fmt --check

# Library, binary, tests, benches and binding, with the published tracker; `features` checks them without it.
clippy:
	cargo clippy -q --workspace --all-targets --features reference -- -D warnings

# Rooms on their own (`temporal`: see `guide`), then what users get; a line of output is a warning or an error. Rooms
# of one level do not import each other (`tests/layering.rs`): such that need the same crates and lower rooms share a run.
features:
	@for rooms in filter,mixture flow,motion3d,segment,stereo io,synth track; do \
		cargo check -q --no-default-features --features $$rooms 2>&1 | (! grep .) || exit 1; done
	@cargo check -q -p jacoflow-python 2>&1 | (! grep .)

rustdoc:
	RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" cargo doc -q --no-deps

# `--workspace` asks for the features of the wheel's library. Unit tests have a library of their own, which takes
# longer to optimise than to run as it is; in the workspace they would link the binding to an interpreter.
rust-test:
	cargo test $(CHECKED) --workspace --test '*'
	cargo test $(CHECKED) --workspace --doc
	cargo test $(CHECKED) --lib $(ASSERTED)

# The page on adding a motion model, followed to the letter in a copy of which the room `temporal` is compiled;
# `tests/affine_flow` tests its example.
guide:
	$(PYTHON) docs/check_guide.py

$(BIN)/maturin:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q "maturin>=1.16,<2"

# As the check tests it (the binding asks for `cli` itself); `compare` builds what users get.
BUILT = $(subst cli ,,$(CHECKED))
wheel: $(BIN)/maturin
	rm -rf $(WHEELS)
	$(BIN)/maturin build -q $(BUILT) --compression-level 9 --out $(WHEELS) -i $(BIN)/python

# What the package and its tests need beside the wheel.
packages: $(BIN)/maturin
	$(BIN)/python -c "import tomllib; p = tomllib.load(open('pyproject.toml', 'rb'))['project']; \
		print(*p['dependencies'], *p['optional-dependencies']['test'], sep='\n')" > $(VENV)/requirements.txt
	$(BIN)/python -m pip install -q --no-compile -r $(VENV)/requirements.txt

install: wheel packages
	$(BIN)/python -m pip install -q --force-reinstall --no-deps $(WHEELS)/jacoflow-*.whl

# One process for each core; files stay whole, so that what a file's tests share is made once.
pytest: install
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

# Hostile files and arguments for about an hour; the tests take 1500 of the CASES. SEED names others.
fuzz: install
	$(BIN)/python tests/fuzz --cases $(or $(CASES),400000) --seed $(or $(SEED),0)

stubtest: install
	cd $(VENV) && bin/python -m mypy.stubtest --allowlist $(CURDIR)/tests/stubtest_allowlist.txt jacoflow

typing: packages
	$(BIN)/python -m mypy --strict python/jacoflow tests/python/test_typing.py

examples: install
	@for file in examples/*.py; do [ -e "$$file" ] || continue; echo "$$file"; $(BIN)/python "$$file" >/dev/null || exit 1; done

# A quick build for work on the binding, installed in place.
develop: $(BIN)/maturin
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop -q --profile develop --extras test

# Ours, as a user would get it, and OpenCV and filterpy in one process; writes a dated table. DATA names a folder of recorded sequences, if there is one.
compare: BUILT := --release
compare: install
	$(BIN)/python -m pip install -q "jacoflow[bench] @ file://$$(ls $(CURDIR)/$(WHEELS)/jacoflow-*.whl)"
	$(BIN)/python -m benchmarks.compare $(if $(DATA),--data $(DATA))

# README's tables out of the newest file in benchmarks/results; the tests check that they are.
readme: $(BIN)/maturin
	$(BIN)/python -m pip install -q numpy
	$(BIN)/python -m benchmarks.readme

# What each heuristic buys: a build with the feature `ablation`, as fast as a user's, in a virtual environment of
# its own.
# ARGUMENTS are those of `python -m benchmarks.ablation`.
ablation: $(BIN)/maturin
	$(PYTHON) -m venv $(VENV)-ablation
	rm -rf target/wheels-ablation
	$(BIN)/maturin build -q --release --features ablation --out target/wheels-ablation -i $(BIN)/python
	$(VENV)-ablation/bin/python -m pip install -q --force-reinstall --no-deps target/wheels-ablation/jacoflow-*.whl
	$(VENV)-ablation/bin/python -m pip install -q "jacoflow[test] @ file://$$(ls $(CURDIR)/target/wheels-ablation/jacoflow-*.whl)"
	$(VENV)-ablation/bin/python -m benchmarks.ablation $(ARGUMENTS)

# API reference from the docstrings: target/doc/jacoflow (Rust), target/doc/python (Python); and README's picture.
docs: rustdoc install
	$(BIN)/python -m pip install -q "pdoc>=15"
	$(BIN)/python -m pdoc --docformat numpy --output-directory target/doc/python jacoflow
	$(BIN)/python docs/overview_picture.py

clean:
	rm -rf target $(VENV) $(VENV)-ablation dist
