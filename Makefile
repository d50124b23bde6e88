# Everything runs from one environment that the first command sets up: `make demo`, `make test`.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
# PyTorch exactly: a bare `torch` may bring gigabytes of another build.
TORCH  := torch==2.13.0
# Without --no-compile most of the set-up goes to compiling modules that are never imported; those that are
# imported are compiled then, and kept.
unexport PYTHONDONTWRITEBYTECODE
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile
# One thread per process: folds and trials run in parallel processes instead.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

# The demo trains its classifier once and loads it the next time; `make clean` forgets it.
TRAINED := $(wildcard out/demo/classifier.npz)

.PHONY: demo test check lint format check-slow bench clean help

help:
	@echo "make demo        set up, then run the paper's comparison with a trained classifier"
	@echo "make test        set up, then run the tests"
	@echo "make check       lint, types, import rules and tests"
	@echo "make check-slow  the checks that take minutes"
	@echo "make bench       compare the reasoner with plingo, ProbLog and plog 2.0 (some 20 minutes)"
	@echo "make format      format the code"
	@echo "make clean       remove the environment and what was made"

demo: $(VENV)/.runtime
	$(BIN)/lcorpp explain intention --fact time=afternoon --fact location=classroom --label zero
	$(BIN)/lcorpp run intention --trials 1000 --out out/demo $(if $(TRAINED),--classifier $(TRAINED),--epochs 12)

test: $(VENV)/.dev
	$(BIN)/python -m pytest -m "not slow"

check: lint test

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check-slow: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet atheris || echo "atheris cannot be installed here: the parser will not be fuzzed"
	$(BIN)/python -m pytest -m slow

# The peers go to an environment of their own, so that theirs are not the versions that the tests see.
bench: $(VENV)-bench/.peers
	$(VENV)-bench/bin/python benchmarks/plog.py

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

$(VENV)/.python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "lcorpp needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/.runtime: pyproject.toml | $(VENV)/.python
	$(PIP) $(TORCH)
	$(PIP) -e '.[torch]'
	touch $@

$(VENV)/.dev: $(VENV)/.runtime
	$(PIP) -e '.[torch,dev]'
	touch $@

$(VENV)-bench/.peers: pyproject.toml
	$(PYTHON) -m venv $(VENV)-bench
	$(VENV)-bench/bin/pip install --quiet --disable-pip-version-check -e '.[bench]'
	touch $@

clean:
	rm -rf $(VENV) $(VENV)-bench out build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
