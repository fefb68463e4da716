# Two commands matter:  make run  (fly a trial)  and  make test.
# make run ARGS="strategy=tbr seed=0:3"      make run PYTHON=python3.12      make lock LOCKFLAGS=--upgrade

ARGS ?= strategy=mcr seed=0
# Tests: a process for each core, up to 8, those of one file in one; all in this very process: make test ARGS_TEST=
ARGS_TEST ?= --numprocesses=auto --maxprocesses=8 --dist=loadfile --no-loadscope-reorder
VENV ?= .venv
PYTHONS ?= python3.13 python3.12 python3.11 python3
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# The first interpreter that really runs (a shim on the path may not) and is a version we support.
SUPPORTED := import sys; (3, 11) <= sys.version_info < (3, 14) or sys.exit(1); print(sys.executable)
PYTHON ?= $(shell for name in $(PYTHONS); do $$name -c '$(SUPPORTED)' 2>/dev/null && break; done)
UV ?= $(shell uv --version >/dev/null 2>&1 && echo uv)

.PHONY: run test fuzz first check docs pages results bench mutants golden conf lock clean
.DELETE_ON_ERROR:

run: $(STAMP)
	@$(BIN)/python -m uavexp $(ARGS)

test: $(STAMP)
	@$(BIN)/python -m pytest $(ARGS_TEST)

# Commands, flights, folders and kills by chance (hours); fewer: make fuzz ARGS_FUZZ="--flights 100 --kills 0"
fuzz: $(STAMP)
	@$(BIN)/python -m tests.fuzz $(ARGS_FUZZ)

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(STAMP)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict

# Tables and numbers of README and site, from the committed results
pages: $(STAMP)
	@$(BIN)/python docs/pages.py

# Every study of experiments/results.yaml flown anew (hours), its results put in place and compared with those
# before; a tenth, nothing put in place: make results FAST=1. What it would fly: make results DRY=1
results: $(STAMP)
	@$(BIN)/python -m uavexp.results $(foreach word,FAST DRY ONLY,$(if $($(word)),$(word)=$($(word))))

bench: $(STAMP)
	@$(BIN)/python -m benchmarks

# From git clone to a moving picture of one's own building, timed in a fresh clone; another: make first FILE=office.ply
first: $(STAMP)
	@$(BIN)/python -m benchmarks.first_picture $(FILE)

# Which of sixty broken lines of the core no test notices (an hour)
mutants: $(STAMP)
	@$(BIN)/python -m tests.mutants $(ARGS_MUTANTS)

# The digests of the golden flights, after a change of numbers that CHANGELOG names
golden: $(STAMP)
	@$(BIN)/python -m tests.golden

# conf/<group>/<option>.yaml of every option, from the fields of its class
conf: $(STAMP)
	@$(BIN)/python -m uavexp.config.generate

# The environment: exactly the locked packages, then this project itself, editable, built by the
# locked back end. Remade when the lock changes; an interpreter that no longer runs is replaced.
$(STAMP): requirements.lock
	@echo "Setting up $(VENV) from requirements.lock (once; about 1.7 GB) ..."
ifneq ($(UV),)
	@$(BIN)/python -c '$(SUPPORTED)' >/dev/null 2>&1 || \
	    $(UV) venv --quiet --clear --python "$(or $(PYTHON),>=3.11$(comma)<3.14)" $(VENV)
	@$(call twice,$(UV) pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock)
	@$(call twice,$(UV) pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e .)
else
	@test -n "$(PYTHON)" || { echo "uavexp needs Python 3.11, 3.12 or 3.13; none of these runs: $(PYTHONS)" >&2; exit 1; }
	@$(BIN)/python -c '$(SUPPORTED); import pip' >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV) || \
	    { echo "$(PYTHON) cannot make environments; on Debian or Ubuntu: apt-get install python3-venv" >&2; exit 1; }
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
endif
	@touch $@

# Every supported Python and platform gets the same versions; the file names no host.
lock:
	@test -n "$(UV)" || { echo "make lock needs uv: pip install uv" >&2; exit 1; }
	$(UV) pip compile pyproject.toml --quiet --extra test --universal --python-version 3.11 \
	    --fork-strategy fewest --generate-hashes --no-emit-index-url --no-emit-find-links \
	    --custom-compile-command "make lock" --output-file requirements.lock $(LOCKFLAGS)

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis dist build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

comma := ,
# uv 0.13 was seen to crash while exiting, once in a hundred runs; its steps may be repeated safely
twice = $(1) || $(1)
