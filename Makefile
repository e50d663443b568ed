# Two commands for a new user: `make demo` and `make test`. Both create the virtual environment on first use.
#
#   make demo       install, replay the bundled recording, compare what was found with the truth
#   make test       fast test suite            make test-all   everything, also the statistical tests
#   make lint       ruff, mypy --strict, layer rules
#   make docs       documentation as a site: out/site/index.html
#   make bench      benchmarks                 make clean      remove build products (keeps the environment)
#
#   make lock       resolve the versions of requirements/ anew for the Python of the environment
#
# PYTHON chooses the interpreter (3.11 or newer), VENV the folder of the environment, WORKERS the test processes, BENCH the
# benchmarks to run (all of them take long): make bench BENCH=benchmarks/live_latency.py

SHELL := /bin/bash
VENV ?= .venv
WORKERS ?= 2
PYTEST_ARGS ?=
# yes: exact versions, every file checked against its SHA-256 (requirements/); no: what the package index has today
LOCKED ?= yes
BENCH ?= $(shell grep -l __main__ benchmarks/*.py)

# The first of these that runs; a version manager may have a python3.12 that only prints a message.
CANDIDATES := python3.12 python3.11 python3.13 python3
PYTHON ?= $(shell for p in $(CANDIDATES); do $$p -c 'import sys; sys.exit(sys.version_info[:2] < (3, 11))' >/dev/null 2>&1 && echo $$p && break; done)

# ROS from pip sets this guard per environment; an inherited one makes the child load the wrong libraries.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export OPENBLAS_NUM_THREADS ?= 1
export OMP_NUM_THREADS ?= 1

BIN := $(VENV)/bin
STAMPS := $(VENV)/.installed

.PHONY: demo test test-all lint docs bench lock clean
.DEFAULT_GOAL := demo

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "No Python 3.11 or newer found; say which with: make PYTHON=/path/to/python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)

# One rule per set of extras; a stamp file remembers what is installed, setup.py and the locked versions decide when it is out of date.
$(STAMPS)-%: setup.py $(wildcard requirements/*.txt) | $(BIN)/python
ifeq ($(LOCKED),yes)
	$(BIN)/python requirements/locked.py install "$*"
else
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[$*]"
endif
	@touch $@

demo: $(STAMPS)-ros
	$(BIN)/ride-estimation demo --out out/demo

test: $(STAMPS)-ros,test
	$(BIN)/python -m pytest -q -n $(WORKERS) $(PYTEST_ARGS)

test-all: $(STAMPS)-ros,test
	$(BIN)/python -m pytest -q -m "slow or not slow" -n $(WORKERS) $(PYTEST_ARGS)

lint: $(STAMPS)-ros,test,lint
	$(BIN)/ruff check ride_estimation test benchmarks docs launch requirements setup.py
	$(BIN)/mypy ride_estimation
	$(BIN)/lint-imports

docs: $(STAMPS)-docs
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs out/site

bench: $(STAMPS)-ros,test
	@for script in $(BENCH); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

lock: $(BIN)/python
	$(BIN)/python requirements/locked.py write

clean:
	rm -rf build install log out *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
