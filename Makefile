# The commands of people and of CI alike. Nothing else is needed first than
# python3 (3.11 or newer), python3-venv and make.
PYTHON ?= python3
VENV ?= .venv
CONSTRAINTS ?= constraints.txt
BIN := $(VENV)/bin

.PHONY: demo test test-slow check docs benchmark clean

demo: $(VENV)/.installed
	$(BIN)/jointz demo

test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m "not slow"

test-slow: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m slow

check: $(VENV)/.installed-check
	$(BIN)/ruff format --check src tests benchmarks
	$(BIN)/ruff check src tests benchmarks
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell src tests benchmarks docs examples README.md ARCHITECTURE.md CONTRIBUTING.md CHANGELOG.md

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "Pages: docs/_build/html/index.html"

benchmark: $(VENV)/.installed-test
	$(BIN)/python -m pytest benchmarks --benchmark-only -q -s

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable .
	touch $@

$(VENV)/.installed-test: pyproject.toml $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable ".[all]" pytest pytest-cov pytest-timeout pytest-benchmark
	touch $@ $(VENV)/.installed

$(VENV)/.installed-check: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) ruff mypy import-linter codespell pandas-stubs
	touch $@

$(VENV)/.installed-docs: docs/requirements.txt $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --requirement docs/requirements.txt
	touch $@

clean:
	rm -rf $(VENV) build dist
