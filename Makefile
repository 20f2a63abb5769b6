# The commands of people and of CI alike. Nothing else is needed first than
# python3 (3.11 or newer), python3-venv and make.
PYTHON ?= python3
VENV ?= .venv
CONSTRAINTS ?= constraints.txt
BIN := $(VENV)/bin

.PHONY: demo test test-slow browser check docs benchmark accuracy validation clean

demo: $(VENV)/.installed
	$(BIN)/jointz demo

test: $(VENV)/.installed-test browser
	$(BIN)/python -m pytest -m "not slow" tests benchmarks --benchmark-disable

test-slow: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m slow

# A browser to look at the report with, where this machine lets us install one; the
# test that needs it is skipped elsewhere.
browser:
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		(apt-get update && apt-get install --yes --no-install-recommends chromium) >/dev/null 2>&1 || true; \
	fi

check: $(VENV)/.installed-check
	$(BIN)/ruff format --check src tests benchmarks conftest.py
	$(BIN)/ruff check src tests benchmarks conftest.py
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell src tests benchmarks docs examples README.md ARCHITECTURE.md CONTRIBUTING.md CHANGELOG.md

docs: $(VENV)/.installed-docs
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo "Pages: docs/_build/html/index.html"

benchmark: $(VENV)/.installed-test
	$(BIN)/python -m pytest benchmarks -q -s

# Every method on simulated people whose truth is known; what is done is kept in .accuracy-cache.
accuracy: $(VENV)/.installed
	$(BIN)/python -m benchmarks.accuracy

# The page of all chapters that the README links to.
validation: $(VENV)/.installed
	$(BIN)/jointz reproduce all --out build/reproduced --overwrite --quiet
	cp build/reproduced/validation.html docs/validation.html

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable .
	touch $@

$(VENV)/.installed-test: pyproject.toml $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable ".[all]" pytest pytest-cov pytest-timeout pytest-benchmark playwright
	touch $@ $(VENV)/.installed

$(VENV)/.installed-check: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) ruff mypy import-linter codespell pandas-stubs
	touch $@

$(VENV)/.installed-docs: docs/requirements.txt $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --requirement docs/requirements.txt
	touch $@

clean:
	rm -rf $(VENV) build dist
