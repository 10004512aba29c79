# `make` lists the verbs. A verb sets up what it needs in .venv by itself; the only requirements are
# make, python3 (3.11 or newer) and pip's access to a package index.
# Another interpreter: make PYTHON=python3.12    Arguments for a script: make bench ARGS="--help"

PYTHON ?= python3
VENV   ?= .venv
ARGS   ?=
PY     := $(VENV)/bin/python
PLOT   := $(VENV)/.stamp-plot
DRAW   := $(VENV)/.stamp-draw
TRAIN  := $(VENV)/.stamp-train
BENCH  := $(VENV)/.stamp-bench
TEST   := $(VENV)/.stamp-test

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:  # two installs into one environment must not overlap, and `make -j` buys nothing here
.PHONY: help reproduce analyse test test-slow lint typecheck contract train evaluate bench docs clean

help:  ## List the verbs
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

reproduce: $(PLOT)  ## Reproduce the paper's figures and tables (installs no learning library)
	$(PY) scripts/reproduce_paper.py $(ARGS)

test: lint typecheck contract  ## Run every check: lint, typecheck, contract, and pytest without the slow tests
	$(PY) -m pytest $(ARGS)

test-slow: $(TEST)  ## Run the slow tests alone
	$(PY) -m pytest -m slow $(ARGS)

lint: $(TEST)  ## Check style and likely bugs (ruff)
	$(PY) -m ruff check .

# The folders `baselines` and `agents` are installed as flexarm_* through an import hook, which mypy does not follow:
# links under their installed names show it the same files.
typecheck: $(TEST)  ## Check types (mypy)
	@mkdir -p build/types
	@ln -sfn ../../baselines build/types/flexarm_baselines
	@ln -sfn ../../agents build/types/flexarm_agents
	$(PY) -m mypy

contract: $(TEST)  ## Check that imports follow the one-way flow (import-linter)
	$(VENV)/bin/lint-imports --no-logo --no-cache

train: $(TRAIN)  ## Train an agent, e.g. make train ARGS="--seed 1"
	$(PY) scripts/train.py $(ARGS)

evaluate: $(TRAIN)  ## Score the controllers, the shipped policy and trained runs
	$(PY) scripts/evaluate.py $(ARGS)

bench: $(BENCH)  ## Measure the speed of simulation and environments beside their peers
	$(PY) scripts/bench.py $(ARGS)

analyse: $(PLOT)  ## Poles, zeros, passivity and margins of the arm: tables, figures, JSON
	$(PY) scripts/analyse.py $(ARGS)

docs: reproduce $(DRAW)  ## Regenerate the pictures, tables and environment pages committed under docs/
	$(PY) scripts/build_docs.py
	$(PY) scripts/analyse.py --docs
	$(PY) scripts/build_env_docs.py
	$(PY) scripts/corner_picture.py

clean:  ## Remove builds and caches (not .venv)
	rm -rf build dist flexarm.egg-info .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find . -path ./$(VENV) -prune -o -type d -name __pycache__ -prune -exec rm -rf {} +

# --- the environment ------------------------------------------------------------------------------------------

# Uses the environment that is there (made by whomever), and makes one where there is none or one without pip.
define ensure_venv
@set -e; fail() { echo "make: $$1" >&2; exit 1; }; \
if ! $(PY) -c 'import pip' >/dev/null 2>&1; then \
  command -v $(PYTHON) >/dev/null || fail "no '$(PYTHON)' here; name a Python 3.11 or newer: make PYTHON=..."; \
  $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
    || fail "$$($(PYTHON) --version 2>&1) is too old; name a Python 3.11 or newer: make PYTHON=..."; \
  if $(PYTHON) -c 'import ensurepip, venv' >/dev/null 2>&1; then $(PYTHON) -m venv $(VENV); \
  else $(PYTHON) -m venv --without-pip $(VENV) && $(PYTHON) -m pip --python $(PY) install pip; fi \
    || fail "could not make the environment $(VENV); install venv and pip (Debian, Ubuntu: apt install python3-venv python3-pip), remove that folder, and run make again."; \
fi
endef

$(PLOT): pyproject.toml constraints.txt
	$(ensure_venv)
	$(PY) -m pip install -e ".[plot]" -c constraints.txt
	@touch $@

$(DRAW): pyproject.toml constraints.txt
	$(ensure_venv)
	$(PY) -m pip install -e ".[plot,render]" -c constraints.txt
	@touch $@ $(PLOT)

$(TRAIN): pyproject.toml constraints.txt
	$(ensure_venv)
	$(PY) -m pip install -e ".[train]" -c constraints.txt
	@touch $@

# EnvPool and MuJoCo have no wheels for every platform; the benchmark goes on without them and says so.
$(BENCH): pyproject.toml constraints.txt
	$(ensure_venv)
	$(PY) -m pip install -e ".[plot,bench]" -c constraints.txt || $(PY) -m pip install -e ".[plot]" -c constraints.txt
	@touch $@

# The test extra contains the plot and the render extra.
$(TEST): pyproject.toml constraints.txt
	$(ensure_venv)
	$(PY) -m pip install -e ".[test]" -c constraints.txt
	@touch $@ $(PLOT) $(DRAW)
