# From a bare clone: `make demo`, `make test`. Set-up is done once and again when setup.py changes.
# `make test` is the part of the tests for every day, `make test-all` is all of them; a part of either
# is named with TESTS=test/test_x.py. VENV and PYTHON choose another environment and interpreter.
SHELL := /bin/bash
VENV  := .venv
READY := $(VENV)/.ready
PY    := $(VENV)/bin/python
PYTHON ?=
# What is run is compiled when it is; most of what is installed is never run. (setuptools warns of what
# an editable installation is.)
INSTALL = PYTHONWARNINGS=ignore $(PY) -m pip install -q --no-compile --use-pep517
# Files side by side, each in one process, the long ones first (test/conftest.py), and one process
# more than there are cores: tests of nodes wait. Each reserves a ROS domain for itself.
JOBS  ?= $(shell echo $$(($$(nproc 2>/dev/null || echo 2) + 1)))
# The tests start hundreds of processes: each would compile the package anew.
export PYTHONDONTWRITEBYTECODE =
PYTEST = $(PY) -m pytest -ra -n $(JOBS) --dist loadfile --no-loadscope-reorder

.PHONY: demo test test-all bench fuzz lint docs clean

demo: $(READY)
	rm -rf imu_noise_demo
	$(PY) -m imu_noise_tools.cli.main demo -o imu_noise_demo

test: $(READY)
	$(PYTEST) -m 'not thorough' $(TESTS)

test-all: $(READY)
	$(PYTEST) $(TESTS)

bench: $(READY)
	@for script in $$(grep -l __main__ bench/*.py); do echo "== $$script"; $(PY) $$script || exit 1; done

# Every bad input on every command, then mutations of good ones for some minutes.
MINUTES ?= 10
fuzz: $(READY)
	IMU_NOISE_CORPUS=all $(PY) -m pytest -q test/test_commands_bad_input.py
	$(PY) bench/fuzz.py --minutes $(MINUTES)

lint: $(READY)
	$(PY) -m flake8
	$(PY) -m pydocstyle imu_noise_tools bench doc launch
	$(PY) -m mypy

# The manual, into build/manual; what Sphinx warns of is an error.
docs: $(VENV)/.docs
	$(PY) -m sphinx -W --keep-going -q -b html doc build/manual
	@echo 'the manual: build/manual/index.html'

$(VENV)/.docs: $(READY)
	$(INSTALL) -e '.[docs]'
	touch $@

clean:
	rm -rf $(VENV) .venv-3.* build install log dist *.egg-info imu_noise_demo .pytest_cache .mypy_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +

# A sourced ROS is used as it is; elsewhere ROS comes from pip. The first interpreter of 3.10 to 3.13 that
# runs is taken (a version manager's shim may be on the PATH and not run). The pip that Python comes with
# takes twice as long over the 270 packages as the newest.
$(READY): setup.py
	@set -e; \
	suits='import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))'; \
	if [ -z "$(PYTHON)" ] && [ -n "$$ROS_DISTRO" ] && python3 -c 'import rclpy' 2>/dev/null; then \
	  python=python3; site=--system-site-packages; extras=test,lint; \
	  echo "set-up: ROS $$ROS_DISTRO is sourced and is used"; \
	else \
	  site=; extras=test,lint,ros; \
	  for python in $(PYTHON) python3 python3.12 python3.11 python3.13 python3.10 none; do \
	    $$python -c "$$suits" 2>/dev/null && break; \
	  done; \
	fi; \
	if [ $$python = none ]; then \
	  echo 'set-up: no Python 3.10 to 3.13 with venv (on Ubuntu: apt install python3-venv)' >&2; exit 1; \
	fi; \
	echo "set-up: $$($$python --version) in $(VENV), some minutes the first time"; \
	$$python -m venv $$site $(VENV); \
	$(INSTALL) --upgrade pip || true; \
	if ! $(INSTALL) -e ".[$$extras]"; then \
	  [ $$extras = test,lint,ros ] || exit 1; \
	  echo 'set-up: ROS is not to be had from pip here; going on without the nodes' >&2; \
	  $(INSTALL) -e '.[test,lint]'; \
	fi; \
	touch $@
