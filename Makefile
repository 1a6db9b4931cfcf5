# Verbs for people and for CI. `make test` is the whole check; it needs Rust, Python >= 3.11, gcc and make, nothing else.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WHEELS := target/wheels
# Wherever clippy, rustdoc and cargo test look at the binding they look at it with the same features, so that crates are built once.
ALL := --features python

.PHONY: test demo format clippy rustdoc rust-test guide wheel install pytest stubtest typing examples develop docs compare clean

test: format clippy rustdoc rust-test guide pytest stubtest typing examples
	@echo "everything passed"

# The main job on an embedded example.
demo:
	cargo run --release -- demo

format:
	cargo fmt --check

clippy:
	cargo clippy -q --all-targets -- -D warnings
	cargo clippy -q --all-targets $(ALL) -- -D warnings

rustdoc:
	RUSTDOCFLAGS="-D warnings -A rustdoc::private-intra-doc-links" cargo doc -q --no-deps

rust-test:
	cargo test

# The page that tells how to add a motion model, followed to the letter in a copy.
guide:
	$(PYTHON) docs/check_guide.py

$(BIN)/maturin:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q "maturin>=1.9.4,<2"

wheel: $(BIN)/maturin
	rm -rf $(WHEELS)
	$(BIN)/maturin build -q --release --out $(WHEELS) -i $(BIN)/python

# The wheel as a user would get it, with what the tests need beside it.
install: wheel
	$(BIN)/python -m pip install -q --force-reinstall --no-deps $(WHEELS)/jacoflow-*.whl
	$(BIN)/python -m pip install -q "jacoflow[test] @ file://$$(ls $(CURDIR)/$(WHEELS)/jacoflow-*.whl)"

pytest: install
	$(BIN)/python -m pytest

stubtest: install
	cd $(VENV) && bin/python -m mypy.stubtest --allowlist $(CURDIR)/tests/stubtest_allowlist.txt jacoflow

typing: install
	$(BIN)/python -m mypy --strict python/jacoflow tests/python/test_typing.py

examples: install
	@for file in examples/*.py; do [ -e "$$file" ] || continue; echo "$$file"; $(BIN)/python "$$file" >/dev/null || exit 1; done

# A quick build for work on the binding: development profile, installed in place.
develop: $(BIN)/maturin
	VIRTUAL_ENV=$(CURDIR)/$(VENV) $(BIN)/maturin develop -q --extras test

# Ours and OpenCV and filterpy in one process; writes a dated table. DATA names a folder of recorded sequences, if there is one.
compare: install
	$(BIN)/python -m pip install -q "jacoflow[bench] @ file://$$(ls $(CURDIR)/$(WHEELS)/jacoflow-*.whl)"
	$(BIN)/python benchmarks/compare.py $(if $(DATA),--data $(DATA))

# API reference from the docstrings: target/doc/jacoflow (Rust), target/doc/python (Python); and README's picture.
docs: rustdoc install
	$(BIN)/python -m pip install -q "pdoc>=15"
	$(BIN)/python -m pdoc --docformat numpy --output-directory target/doc/python jacoflow
	$(BIN)/python docs/overview_picture.py

clean:
	rm -rf target $(VENV) dist
