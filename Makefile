# `make demo` and `make test` do everything, set-up included; both create and reuse .venv.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
STAMP := $(VENV)/.installed

.PHONY: demo test test-slow lint bench study-quick clean

$(STAMP): pyproject.toml
	test -x $(PY) || $(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@

demo: $(STAMP)
	$(PY) scripts/run.py fly-by --out out/demo

lint: $(STAMP)
	$(VENV)/bin/ruff check .
	$(VENV)/bin/pyright

test: $(STAMP)
	$(PY) -m pytest

test-slow: $(STAMP)
	$(PY) -m pytest -m slow

study-quick: $(STAMP)
	$(PY) scripts/suitability.py --scale quick --out out/study-quick

bench: $(STAMP)
	$(PY) scripts/bench.py --out out/bench

clean:
	rm -rf out .cache
