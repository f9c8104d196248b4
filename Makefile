# make demo: check two real models. make study: the cell-injection study, into study-output/.
# make growth: time and memory against states, into benchmarks/results/. make test: the test suite.
# make check: everything that CI runs on one version of Python. make coverage: the test suite, with
# the lines that it executes. make lessons: the notebooks, from lessons/. make docs: the site of the
# documentation with the executed lessons, into build/site. make editors: the extension for VS Code
# with its tests, and the workbench's bundle against its sources.
# Each target sets up a virtual environment in .venv; it needs python3, make, gcc and a package index.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
COMPILED := $(shell find src -name '*.pyx' -o -name '*.pxd' -o -name '*.pxi')
STAMP := $(VENV)/.stamp
SOURCES := src tests benchmarks docs verify models/*/*.py setup.py stubs.py

.PHONY: demo study growth test check coverage lessons docs editors format clean

demo: $(STAMP)-base
	$(BIN)/symcheck models/crowds/crowds.pm models/crowds/crowds.pctl -const TotalRuns=5,CrowdSize=10
	$(BIN)/symcheck models/cell_injection/cell_injection.pm models/cell_injection/cell_injection.pctl -ex -reduce \
	    -const CellBoundaryX=175,CellBoundaryY=175,NoisePercentage=0.01,StepSizeXY=18 \
	    -const 'InitialPositionXY=100,MaxDistance=250,Damping=1,ForceBound={10,5}'

study: $(STAMP)-study
	$(BIN)/python models/cell_injection/study.py --out study-output

growth: $(STAMP)-test
	$(BIN)/python benchmarks/growth.py

test: $(STAMP)-test
	$(BIN)/python -m pytest -n auto -q

check: $(STAMP)-check
	$(BIN)/ruff check $(SOURCES) lessons
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/mypy
	$(BIN)/mypy verify/symcheck_verify.py verify/symcheck_verify_derived.py docs/make_lessons.py
	$(BIN)/lint-imports
	$(BIN)/zensical build --clean --strict
	$(BIN)/python -m pytest -n auto -q

# Twice as slow as the suite: tracing.
coverage: $(STAMP)-check
	$(BIN)/python -m pytest -n auto -q --cov --cov-report=term:skip-covered

lessons: $(STAMP)-test
	$(BIN)/python docs/make_lessons.py

docs: $(STAMP)-check
	$(BIN)/zensical build --clean --strict
	$(BIN)/python docs/make_lessons.py build/site

# These need Node 20 and its package index too.
editors: $(STAMP)-test
	cd editors/vscode && npm ci --silent && npm run --silent build && \
	    SYMCHECK_LSP=$(abspath $(BIN))/symcheck-lsp npm test
	cd workbench-ui && npm ci --silent && npm run --silent check

format: $(STAMP)-check
	$(BIN)/ruff check --fix $(SOURCES)
	$(BIN)/ruff format $(SOURCES)

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

# The installation is editable: only a change of compiled code or of the packaging installs again.
# The extras are then installed by name, which compiles nothing twice.
$(STAMP)-base: $(VENV)/bin/python pyproject.toml setup.py stubs.py $(COMPILED)
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(STAMP)-study: $(STAMP)-base
	$(BIN)/python -m pip install --quiet 'symcheck[plot]'
	touch $@

$(STAMP)-test: $(STAMP)-base
	$(BIN)/python -m pip install --quiet 'symcheck[test]'
	touch $@

$(STAMP)-check: $(STAMP)-test
	$(BIN)/python -m pip install --quiet 'symcheck[check]'
	touch $@

clean:
	rm -rf $(VENV) build dist src/*.egg-info
	find src \( -name '*.so' -o -name '*.c' \) -delete
