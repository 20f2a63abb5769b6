# The commands of people and of CI alike. Nothing else is needed first than
# python3 (3.11 or newer), python3-venv and make.
PYTHON ?= python3
VENV ?= .venv
CONSTRAINTS ?= constraints.txt
BIN := $(VENV)/bin

.PHONY: demo test quick test-slow test-osl test-bare browser check docs benchmark accuracy reproduce paper release clean

demo: $(VENV)/.installed
	$(BIN)/jointz demo

# JOINTZ_REQUIRE: a test that would skip for want of one of these fails. Tests that keep real time
# run alone, the others as many at once as there are cores.
REQUIRE := JOINTZ_REQUIRE="dask pyarrow nicegui"
TESTED := tests reproduction/tests -q --durations=30
# As many threads of BLAS as cores in each of as many processes wait for each other, for minutes.
test quick test-slow: export OPENBLAS_NUM_THREADS = 1
test: $(VENV)/.installed-test browser
	$(REQUIRE) $(BIN)/python -m pytest -m "not slow and not alone" $(TESTED) --numprocesses auto --dist worksteal
	$(REQUIRE) $(BIN)/python -m pytest -m "not slow and alone" $(TESTED)

# The tests that a change reaches, the nearest first, for a minute.
quick: $(VENV)/.installed-test
	$(BIN)/python tests/quick.py

# All slow tests, or those of one part: make test-slow PART=identify. What a change touches is owed
# before it lands.
SLOW_PARTS := identify stats runtime files docs reproduction
SLOW_identify := tests/unit/identify tests/unit/benchmarks \
	tests/integration/test_own_joint.py tests/integration/test_real_legs.py \
	tests/integration/test_refusal_rates.py tests/integration/test_steep_change.py
SLOW_stats := tests/unit/stats tests/unit/kernels tests/unit/pooling tests/unit/comparison \
	tests/integration/test_calibration_of_tests.py
SLOW_runtime := tests/unit/rig $(wildcard tests/integration/test_run*.py)
SLOW_docs := tests/unit/docs tests/integration/test_demo.py
SLOW_reproduction := reproduction/tests
# What no other part names.
SLOW_named := $(foreach part,identify stats runtime docs,$(SLOW_$(part)))
SLOW_files := tests $(addprefix --ignore=,$(SLOW_named))
PART ?= $(SLOW_PARTS)
test-slow: $(VENV)/.installed-test
	@for part in $(PART); do case " $(SLOW_PARTS) " in *" $$part "*) ;; \
		*) echo "PART=$$part: expected one of $(SLOW_PARTS)" >&2; exit 2;; esac; done
	$(foreach part,$(PART),$(call slow_part,$(SLOW_$(part))))
# Those that keep real time run alone; a part may have none (5).
define slow_part
	$(BIN)/python -m pytest -m "slow and not alone" $(1) --numprocesses auto --dist worksteal
	$(BIN)/python -m pytest -m "slow and alone" $(1) || [ $$? = 5 ]

endef

# The drivers on the real opensourceleg and flexsea, and the main jobs on the numpy and pandas
# that these need.
test-osl: .venv-osl/.installed-osl
	JOINTZ_REQUIRE="opensourceleg flexsea" .venv-osl/bin/python -m pytest tests/unit/rig/devices -k "opensourceleg or dephy"
	rm -rf build/osl
	mkdir -p build/osl
	.venv-osl/bin/jointz --help >build/osl/help.txt
	.venv-osl/bin/jointz run walking --participants 1 --seed 1 --out build/osl/study --quiet
	.venv-osl/bin/jointz analyze build/osl/study --out build/osl/results --resamples 100 --quiet

# The package as people install it, without extras: it runs the main jobs, and what needs an
# extra says which command installs it.
test-bare:
	rm -rf .venv-bare build/bare
	$(PYTHON) -m venv .venv-bare
	.venv-bare/bin/python -m pip install --quiet --constraint constraints.txt .
	mkdir -p build/bare
	cd build/bare && ../../.venv-bare/bin/jointz demo --quick --quiet
	cd build/bare && ../../.venv-bare/bin/jointz run walking --participants 1 --seed 1 --out study --quiet
	cd build/bare && ../../.venv-bare/bin/jointz analyze study --out results --resamples 100 --quiet
	cd build/bare && for asked in "app console walking --out console" "app explore results" \
			"parquet pool results --out pooled" \
			"scale analyze study --out other --scheduler local"; do \
		page=$${asked#* } extra=$${asked%% *} status=0; \
		../../.venv-bare/bin/jointz $$page 2>said.txt || status=$$?; \
		if [ $$status != 2 ] || ! grep -qF "pip install \"jointz[$$extra]\"" said.txt; then \
			echo "jointz $$page: expected status 2 and the command that installs the extra; got $$status and:" >&2; \
			cat said.txt >&2; exit 1; \
		fi; \
	done

# A browser to look at the report with, where this machine lets us install one; the
# test that needs it is skipped elsewhere.
browser:
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null || \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
		(apt-get update && apt-get install --yes --no-install-recommends chromium) >/dev/null 2>&1 || true; \
	fi

check: $(VENV)/.installed-check
	$(BIN)/ruff format --check src reproduction tests benchmarks examples docs/*.py docs/from_matlab paper .ci conftest.py
	$(BIN)/ruff check src reproduction tests benchmarks examples docs/*.py docs/from_matlab paper .ci conftest.py
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell src reproduction tests benchmarks docs examples paper .ci .github *.md

# docs/api goes first: a page of what has been moved would be a warning.
docs: $(VENV)/.installed-docs
	rm -rf docs/api
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	$(BIN)/python docs/check_site.py docs/_build/html
	@echo "Pages: docs/_build/html/index.html"

# The commands beside the peers that can be installed here, and docs/benchmarks.md. The machine
# should do nothing else.
benchmark: .venv-peers/.installed-peers
	-$(MAKE) .venv-osl/.installed-osl
	.venv-peers/bin/python -m benchmarks.speed

# Every method on simulated people whose truth is known; what is done is kept in .accuracy-cache.
accuracy: $(VENV)/.installed
	$(BIN)/python -m benchmarks.accuracy

# The dissertation again, or CHAPTER=4 of it; of all chapters the page that the README links to.
CHAPTER ?= all
reproduce: $(VENV)/.installed
	$(BIN)/python -m reproduction $(CHAPTER) --out build/reproduced --overwrite --quiet
	$(if $(filter all,$(CHAPTER)),cp build/reproduced/validation.html docs/validation.html)

# The paper for the Journal of Open Source Software: all numbers and the figure from docs/tables,
# docs/validation.html and the package.
paper: $(VENV)/.installed
	$(BIN)/python paper/make_paper.py

# Whether this commit can be released; wheel and sdist are left in dist.
release:
	$(PYTHON) .ci/release.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable .
	touch $@

$(VENV)/.installed-test: pyproject.toml $(CONSTRAINTS) | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable ".[all]" pytest pytest-cov pytest-timeout pytest-xdist playwright ezc3d
	touch $@ $(VENV)/.installed

$(VENV)/.installed-check: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) ruff mypy import-linter codespell pandas-stubs
	touch $@

# flexsea wants an older date library than the rest; constraints-osl.txt has versions that fit all.
.venv-osl/.installed-osl: pyproject.toml constraints-osl.txt
	test -x .venv-osl/bin/python || $(PYTHON) -m venv .venv-osl
	.venv-osl/bin/python -m pip install --quiet --constraint constraints-osl.txt \
		--editable ".[parquet,testing,osl,dephy]" pytest pytest-timeout || { \
		echo "test-osl: opensourceleg 3.5 and flexsea 12 cannot be installed here, so that the drivers are NOT tested on them. This is a failure, not a skip." >&2; \
		exit 1; }
	touch $@

# Who the benchmarks stand beside, in an environment of its own: none of them is a dependency, and
# spm1d is under the GPL. Who cannot be installed here is named on the page.
.venv-peers/.installed-peers: pyproject.toml $(CONSTRAINTS)
	test -x .venv-peers/bin/python || $(PYTHON) -m venv .venv-peers
	.venv-peers/bin/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable ".[all]"
	for peer in mujoco statsmodels spm1d; do \
		.venv-peers/bin/python -m pip install --quiet --constraint $(CONSTRAINTS) $$peer || \
		echo "benchmark: $$peer cannot be installed here, and is left out." >&2; \
	done
	touch $@

$(VENV)/.installed-docs: docs/requirements.txt $(CONSTRAINTS) | $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --constraint $(CONSTRAINTS) --editable ".[formats,scale]" --requirement docs/requirements.txt
	touch $@

clean:
	rm -rf $(VENV) .venv-osl .venv-peers .venv-bare build dist docs/_build docs/api docs/gallery docs/traps
