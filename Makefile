# Everything runs in a virtual environment that make sets up itself: it takes Python 3.11 or later
# with venv, and pip's package index. Only `make lock` needs uv, and installs it. A C compiler is used
# where there is one; where not, the installation takes one from the index for itself: hatch_build.py.

PYTHON ?= python3
VENV   ?= .venv
LOWEST ?= .venv-lowest
STUDY  ?= studies/oberst2016
ARGS   ?=

PIP = -m pip --disable-pip-version-check -qq
BIN = $(VENV)/bin

# A stamp is as new as the last complete installation.
RUNTIME = $(VENV)/.installed
DEV = $(VENV)/.installed-dev
DOCS = $(VENV)/.installed-docs
LOWEST_DEV = $(LOWEST)/.installed-dev

# The kernel is compiled by the installation, into the source tree.
COMPILED = hatch_build.py $(wildcard hipuq/compiled/*.[ch])
CHECK_KERNEL = ls hipuq/compiled/_kernel.* >/dev/null 2>&1 || \
	echo "hipuq: no compiled kernel, LAPACK takes its place, slower; pip install -v -e . says why"

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help study test test-lowest bench docs lint types lock clean

help:  ## List the targets
	@sed -n 's/^\([a-z-]*\):[^#]*## /\1 /p' Makefile | while read -r name what; \
	do printf '  make %-12s %s\n' "$$name" "$$what"; done

study: $(RUNTIME)  ## Run the study in STUDY, by default studies/oberst2016; ARGS go to hipuq run
	$(BIN)/hipuq run "$(STUDY)" $(ARGS)

test: $(DEV)  ## Run the tests; ARGS go to pytest
	$(BIN)/python -m pytest -n auto $(ARGS)

# Old releases warn of what newer releases of their own dependencies are about to drop: no errors here.
test-lowest: $(LOWEST_DEV)  ## Run the tests with the lowest versions that pyproject.toml allows
	$(LOWEST)/bin/python -m pytest -n auto -W "ignore::DeprecationWarning" \
		-W "ignore::PendingDeprecationWarning" $(ARGS)

bench: $(DEV)  ## Measure speed against NumPy, chaospy and SALib, see docs/speed.md; ARGS go to pytest
	$(BIN)/python -m pytest -c tests/benchmarks/pytest.ini tests/benchmarks $(ARGS)

docs: $(DOCS)  ## Build the documentation into build/html and run the code in it; ARGS go to pytest
	$(BIN)/python -m sphinx -W --keep-going -q -j auto -b html docs build/html
	@echo "documentation: build/html/index.html"
	$(BIN)/python -m pytest -n auto --dist loadfile --doctest-modules $(PAGES) $(ARGS)

PAGES = README.md CONTRIBUTING.md docs hipuq

lint: $(DEV)  ## Check the format and the rules of the code
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(DEV)  ## Check the types
	$(BIN)/mypy

lock: $(BIN)/pip  ## Take the newest versions into constraints.txt, the lowest into constraints-lowest.txt
	$(BIN)/python $(PIP) install uv
	$(BIN)/uv $(COMPILE) --all-extras --output-file constraints.txt pyproject.toml
	$(BIN)/uv $(COMPILE) --extra dev --extra dask --resolution lowest-direct \
		--output-file constraints-lowest.txt pyproject.toml

COMPILE = pip compile --quiet --universal --python-version 3.11 --upgrade --no-annotate \
	--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock"

clean:  ## Remove the environments, caches and builds; results stay
	rm -rf "$(VENV)" "$(LOWEST)" build dist docs/reference/api .pytest_cache .mypy_cache .ruff_cache .hypothesis
	rm -f hipuq/compiled/_kernel.*
	find hipuq tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(RUNTIME): pyproject.toml constraints.txt $(COMPILED) | $(BIN)/pip
	@echo "Installing hipuq into $(VENV)"
	@$(BIN)/python $(PIP) install -c constraints.txt -e .
	@$(CHECK_KERNEL)
	@touch $@

$(DEV): pyproject.toml constraints.txt $(COMPILED) | $(BIN)/pip
	@echo "Installing hipuq and what its tests need into $(VENV)"
	@$(BIN)/python $(PIP) install -c constraints.txt -e ".[dev]"
	@$(CHECK_KERNEL)
	@touch $(RUNTIME) $@

$(DOCS): $(DEV)
	@echo "Installing what the documentation needs into $(VENV)"
	@$(BIN)/python $(PIP) install -c constraints.txt -e ".[docs]"
	@touch $@

$(LOWEST_DEV): pyproject.toml constraints-lowest.txt $(COMPILED) | $(LOWEST)/bin/pip
	@echo "Installing hipuq, what its tests need, and dask, lowest versions, into $(LOWEST)"
	@$(LOWEST)/bin/python $(PIP) install -c constraints-lowest.txt -e ".[dev,dask]"
	@$(CHECK_KERNEL)
	@touch $@

# pip comes last, so an environment without it is not complete.
%/bin/pip:
	@echo "Making the environment $*"
	@"$(PYTHON)" -m venv "$*"
