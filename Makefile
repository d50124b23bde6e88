# Everything runs from one environment that the first command sets up: `make demo`, `make test`.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
# Where wheels are.
DIST   ?= dist
# PyTorch exactly: a bare `torch` may bring gigabytes of another build.
TORCH  := torch==2.13.0
# Without --no-compile most of the set-up goes to compiling modules that are never imported; those that are
# imported are compiled then, and kept.
unexport PYTHONDONTWRITEBYTECODE
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile
# One thread per process: folds and trials run in parallel processes instead.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

# The C++ kernels are built when the package is installed; their objects are kept in build/ for the next time.
NATIVE := pyproject.toml CMakeLists.txt $(wildcard native/* native/*/* native/*/*/*)

# The demo trains its classifier once and loads it the next time; `make clean` forgets it.
TRAINED := $(wildcard out/demo/classifier.npz)

.PHONY: demo test check lint format stubs docs check-slow coverage sanitize bench wheel clean help

help:
	@echo "make demo        set up, then run the paper's comparison with a trained classifier, and CORPP's"
	@echo "make test        set up, then run the tests"
	@echo "make check       lint, types, import rules and tests"
	@echo "make check-slow  the checks that take minutes"
	@echo "make docs        build the documentation's site into build/site"
	@echo "make bench       compare with plingo, ProbLog, plog 2.0, pyAgrum, APPL and Keras, those that are there (some 50 minutes)"
	@echo "make wheel       build wheels for Linux into dist/, which make demo then installs instead of compiling"
	@echo "make coverage    run the tests and print which share of the lines they run"
	@echo "make format      format the code"
	@echo "make stubs       regenerate the type stubs of the C++ kernels"
	@echo "make clean       remove the environment and what was made"

demo: $(VENV)/.runtime
	$(BIN)/lcorpp explain intention --fact time=afternoon --fact location=classroom --label zero --truth interested --answers pos,pos,pos
	$(BIN)/lcorpp run intention --trials 1000 --out out/demo $(if $(TRAINED),--classifier $(TRAINED),--learner lstm-fast)
	$(BIN)/lcorpp run shopping --trials 1000 --time-limit 10 --out out/demo-shopping

test: $(VENV)/.dev
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist worksteal

check: lint test

lint: $(VENV)/.packages
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check-slow: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet atheris || echo "atheris cannot be installed here: the parser will not be fuzzed"
	$(BIN)/python -m pip install --quiet playwright || echo "Playwright cannot be installed here: the page will not be played"
	$(BIN)/python -m pytest -m slow
	$(BIN)/python -m pytest -m "hypothesis and not slow" -n 2 --hypothesis-profile search
	$(MAKE) sanitize

# The share of lines that the tests run, in their process and in those that they start.
coverage: $(VENV)/.dev
	$(PIP) "coverage[toml]>=7.10" pytest-cov
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist worksteal --cov --cov-report=term:skip-covered --cov-report=xml:build/coverage.xml

# Wheels for other machines: for Python 3.11, and for 3.12 and newer, by the first of these that is there.
WHEEL_PYTHONS ?= $(PYTHON) python3.11 python3.12 python3.13 python3.14 $(wildcard $(HOME)/.pyenv/versions/3.1[1-9]*/bin/python3)
# Processors: x86_64, aarch64.
TARGETS ?= x86_64
wheel:
	$(PYTHON) tools/build_wheels.py --dist $(DIST) $(addprefix --target ,$(TARGETS)) $(WHEEL_PYTHONS)

# The C++ kernels under the address and undefined-behaviour sanitizers, in an environment of their own.
sanitize: $(VENV)-sanitize/.installed
	LD_PRELOAD="$$($(CXX) -print-file-name=libasan.so) $$($(CXX) -print-file-name=libstdc++.so)" ASAN_OPTIONS=detect_leaks=0 \
	  $(VENV)-sanitize/bin/python -m pytest -m "not slow" tests/planning tests/learning/lstm \
	  tests/reasoning/circuit tests/reasoning/diagram tests/reasoning/transitions tests/reasoning/factors

$(VENV)-sanitize/.installed: $(NATIVE)
	$(PYTHON) -m venv $(VENV)-sanitize
	$(VENV)-sanitize/bin/pip install --quiet --disable-pip-version-check --config-settings cmake.define.LCORPP_SANITIZE=ON . pytest hypothesis
	touch $@

# Models that the planner's benchmark solves, and pomdpsol, too, where it is on the PATH.
MODELS ?= $(wildcard src/lcorpp/domains/*/*.pomdp ../shared/pomdp/*.pomdp ../shared/pomdp/*.pomdpx)

# The peers go to an environment of their own, so that theirs are not the versions that the tests see.
bench: $(VENV)-bench/.peers
	$(VENV)-bench/bin/python benchmarks/plog.py
	$(VENV)-bench/bin/python benchmarks/networks.py
	$(VENV)-bench/bin/python benchmarks/sarsop.py $(MODELS)
	$(VENV)-bench/bin/python benchmarks/dialogues.py
	$(VENV)-bench/bin/python benchmarks/online.py
	$(VENV)-bench/bin/python benchmarks/generative.py --episodes 20,10,10
	$(VENV)-bench/bin/python benchmarks/model_learning.py --seeds 3 --counts 200
	$(VENV)-bench/bin/python benchmarks/limits.py --models 40
	$(VENV)-bench/bin/python benchmarks/large_models.py
	$(VENV)-bench/bin/python benchmarks/learner.py

format: $(VENV)/.packages
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The type stubs of the C++ kernels, from the signatures of the bindings.
stubs: $(VENV)/.dev
	$(BIN)/python -m nanobind.stubgen -q -m lcorpp.planning._native -o src/lcorpp/planning/_native.pyi
	$(BIN)/python -m nanobind.stubgen -q -m lcorpp.planning.formats.pomdp._scanner -o src/lcorpp/planning/formats/pomdp/_scanner.pyi
	$(BIN)/python -m nanobind.stubgen -q -m lcorpp.reasoning._diagram -o src/lcorpp/reasoning/_diagram.pyi
	$(BIN)/python -m nanobind.stubgen -q -m lcorpp.reasoning.factors._tables -o src/lcorpp/reasoning/factors/_tables.pyi
	$(BIN)/python -m nanobind.stubgen -q -m lcorpp.model_learning._episodes -o src/lcorpp/model_learning/_episodes.pyi
	$(BIN)/python -m nanobind.stubgen -q -m lcorpp.learning.lstm._kernels -o src/lcorpp/learning/lstm/_kernels.pyi

# Warnings are errors. Once the packages are installed, the build needs no network.
docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -q -W --keep-going -j auto -b html docs build/site
	@echo "the site is in build/site/index.html"

$(VENV)/.docs: pyproject.toml | $(VENV)/.runtime
	$(PIP) -e '.[plots,docs]'
	@rm -f $(VENV)/.wheel
	touch $@

NO_COMPILER := no C++ compiler, which lcorpp needs: install g++ (Debian, Ubuntu: apt install g++; macOS: xcode-select --install)
REQUIRE_COMPILER = command -v $${CXX:-c++} >/dev/null || { echo "$(NO_COMPILER)" >&2; exit 1; }

$(VENV)/.python:
	@$(if $(wildcard $(DIST)/lcorpp-*.whl),,$(REQUIRE_COMPILER))
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "lcorpp needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	touch $@

# A wheel of these sources in dist/ saves compiling; once a source changes, it no longer fits (.wheel: it was installed).
# The C++ kernels train the LSTM; PyTorch does where the compiler is too old for them.
$(VENV)/.runtime: $(NATIVE) $(if $(wildcard $(VENV)/.wheel),$(shell find src -type f -not -path "*/__pycache__/*")) | $(VENV)/.python
	@rm -f $(VENV)/.wheel
	if wheel=$$($(BIN)/python tools/fitting_wheel.py $(DIST)); then \
	  $(BIN)/pip uninstall --quiet --yes lcorpp 2>/dev/null; $(PIP) "$$wheel[plots]" && touch $(VENV)/.wheel; \
	else $(PIP) -e '.[plots]' && { $(BIN)/python -c 'import lcorpp.learning.lstm._kernels' 2>/dev/null || $(PIP) $(TORCH); }; fi
	touch $@

# The kernels compile while the packages are installed.
REQUIREMENTS := import sys, tomllib; own = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
  print(*own["dependencies"], *[r for e in sys.argv[1:] for r in own["optional-dependencies"][e]], sep="\n")

$(VENV)/.packages: $(NATIVE) | $(VENV)/.python
	$(BIN)/python -c '$(REQUIREMENTS)' plots fetch dev > $(VENV)/requirements.txt
	$(PIP) --no-deps -e . & kernels=$$!; $(PIP) -r $(VENV)/requirements.txt; installed=$$?; wait $$kernels && exit $$installed
	@rm -f $(VENV)/.wheel
	touch $@ $(VENV)/.runtime

# The linters do without PyTorch.
$(VENV)/.dev: $(VENV)/.packages
	$(PIP) $(TORCH)
	touch $@

$(VENV)-bench/.peers: pyproject.toml
	$(PYTHON) -m venv $(VENV)-bench
	$(VENV)-bench/bin/pip install --quiet --disable-pip-version-check $(TORCH)
	$(VENV)-bench/bin/pip install --quiet --disable-pip-version-check -e '.[bench]'
	touch $@

clean:
	rm -rf $(VENV) $(VENV)-bench $(VENV)-sanitize out build dist .coverage* .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
