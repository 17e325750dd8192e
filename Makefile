# `make demo` and `make test` do everything, set-up included; both create and reuse .venv.
PYTHON ?= python3
VENV := .venv
PY := $(VENV)/bin/python
INSTALL := $(PY) -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable
BASE := $(VENV)/.base
STAMP := $(VENV)/.installed
DOCS := $(VENV)/.docs
MUTANTS := $(VENV)/.mutants
HISTORY := $(VENV)/.history

.PHONY: demo live test test-fast test-slow mutants kills lint bench bench-history study-quick solvers docs constraints clean

# the base alone, which is enough for the demo
$(BASE): pyproject.toml constraints.txt
	test -x $(PY) || $(PYTHON) -m venv $(VENV)
	$(INSTALL) .
	touch $@

# every extra that tests, studies and the benchmark use
$(STAMP): $(BASE)
	$(INSTALL) '.[test]'
	touch $@

$(DOCS): $(BASE)
	$(INSTALL) '.[docs]'
	touch $@

$(MUTANTS): $(STAMP)
	$(INSTALL) '.[mutants]'
	touch $@

$(HISTORY): $(STAMP)
	$(INSTALL) '.[history]'
	touch $@

demo: $(BASE)
	$(PY) scripts/run.py fly-by --out out/demo

live: $(BASE)
	$(PY) scripts/live.py fly-by

lint: $(STAMP)
	$(VENV)/bin/ruff check .
	$(VENV)/bin/clang-format --dry-run --Werror renderer/*/native/*.h analysis/bench/native/*.c
	$(VENV)/bin/pyright

# on all cores, as far as memory allows; a worker continues with neighbouring tests, which share fixtures
test: $(STAMP)
	$(PY) -m pytest -n auto --dist worksteal

# the tests nearest to the changes since the main branch, or to named modules: make test-fast MODULES='tsar/morton.py'
test-fast: $(STAMP)
	$(PY) -m tests.changed $(MODULES)

test-slow: $(STAMP)
	$(PY) -m pytest -m slow

# changes of single operators and numbers, and how many of them the nearest tests notice; continues where it ended
mutants: $(MUTANTS)
	$(PY) -m tests.mutants

# 50 kills of every long command, which then continues
kills: $(STAMP)
	$(PY) -m tests.killed

study-quick: $(STAMP)
	$(PY) scripts/suitability.py --scale quick --out out/study-quick

# every transport solver on every input, at row 7; finished runs are not repeated
solvers: $(STAMP)
	$(PY) scripts/suitability.py --scale quick --rows 7 --policies thesis --rivals framed-1 --beside framed-1 --jod-repetitions 0 --out out/solvers \
		--solvers trivial slow_greater scale_lesser square descend diffusion

bench: $(STAMP)
	$(PY) scripts/bench.py --out out/bench

# adds the figures of this commit to .asv/results and shows them; `asv compare COMMIT COMMIT` and `asv publish` show several
bench-history: $(HISTORY)
	$(VENV)/bin/asv machine --yes
	$(VENV)/bin/asv run --python=same --set-commit-hash $$(git rev-parse HEAD)

# needs no network once its packages are installed
docs: $(DOCS)
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --quiet

# records the installed versions of all extras, which it installs first: what is missing would lose its line
constraints: $(BASE)
	$(INSTALL) '.[test,docs,mutants,history]'
	$(PY) -m pip list --format=freeze --exclude-editable > $(VENV)/.frozen
	grep -v ^pip== $(VENV)/.frozen | sed 's/+cpu$$//' > $(VENV)/.constraints
	mv $(VENV)/.constraints constraints.txt

clean:
	rm -rf out .cache site
