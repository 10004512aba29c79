# `make` lists the verbs. A verb sets up what it needs in .venv by itself; the only requirements are
# make, python3 (3.11 or newer) and pip's access to a package index.
# Another interpreter: make PYTHON=python3.12    Arguments for a script: make bench ARGS="--help"
# Processes that share the tests: make test JOBS=4
# Versions are those of constraints.txt, which `make lock` renews. Another set, in an environment of its own: make test-fast VENV=build/lowest CONSTRAINTS=constraints-lowest.txt

PYTHON ?= python3
VENV   ?= .venv
ARGS   ?=
JOBS   ?= 2
CONSTRAINTS ?= constraints.txt
PY     := $(VENV)/bin/python
HAS    := $(VENV)/.stamp

# What a verb needs beside the package, as extras of pyproject.toml; the verb names it $(HAS)-NAME.
EXTRAS_plot  := plot
EXTRAS_draw  := plot,render
EXTRAS_train := train
EXTRAS_agent := plot,train,chain
EXTRAS_bench := plot,bench
EXTRAS_validate := validate
EXTRAS_board := plot,chain
EXTRAS_test  := test
EXTRAS_dist  := release
EXTRAS_site  := site
# The others that it contains, and what is installed where the extras cannot be: EnvPool and the engines have no wheels for
# every platform; the benchmark goes on without them and says so, and `make validate` skips what needs them.
COVERS_draw  := plot
COVERS_validate := plot
COVERS_agent := plot train
COVERS_test  := plot draw validate
INSTEAD_bench := plot
INSTEAD_validate := plot,checks
INSTEAD_board := plot

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:  # two installs into one environment must not overlap, and `make -j` buys nothing here
.PHONY: help reproduce validate analyse optimise control test test-fast test-slow lint typecheck contract train agent learning evaluate leaderboard board-docs bench docs site dist lock clean

help:  ## List the verbs
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

reproduce: $(HAS)-plot  ## Reproduce the paper's figures and tables (installs no learning library)
	$(PY) -m scripts.paper $(ARGS)

validate: $(HAS)-validate  ## Check the physics against exact beams, finite elements, MuJoCo, Exudyn and its own invariants
	$(PY) -m pytest tests/validation -m validation -n $(JOBS) --dist loadfile --junitxml=results/validation/report.xml $(ARGS)

analyse: $(HAS)-plot  ## Poles, zeros, passivity and margins of the arm: tables, figures, JSON
	$(PY) -m scripts.analysis $(ARGS)

optimise: $(HAS)-plot  ## Find the best known laps by trajectory optimisation
	$(PY) -m scripts.optimise $(ARGS)

control: $(HAS)-plot  ## Compare controllers on the standard laps: tables of what was tried
	$(PY) -m scripts.control $(ARGS)

test: lint typecheck contract test-fast  ## Run every check: lint, typecheck, contract, and pytest without the slow tests

test-fast: $(HAS)-test  ## Run pytest alone, without the slow tests: mypy reads the types of the newest libraries only
	$(PY) -m pytest -n $(JOBS) --dist worksteal $(ARGS)

test-slow: $(HAS)-test  ## Run the slow tests alone
	$(PY) -m pytest -m "slow and not validation" $(ARGS)

lint: $(HAS)-test  ## Check style and likely bugs (ruff)
	$(PY) -m ruff check .

# The folders `baselines` and `agents` are installed as flexarm_* through an import hook, which mypy does not follow:
# links under their installed names show it the same files.
typecheck: $(HAS)-test  ## Check types (mypy)
	@mkdir -p build/types
	@ln -sfn ../../baselines build/types/flexarm_baselines
	@ln -sfn ../../agents build/types/flexarm_agents
	$(PY) -m mypy
	$(PY) -m scripts.docs.snippets
	$(PY) -m mypy build/snippets docs/recipes/cleanrl_ppo.py

contract: $(HAS)-test  ## Check that imports follow the one-way flow (import-linter)
	$(VENV)/bin/lint-imports --no-logo --no-cache

train: $(HAS)-train  ## Train an agent, e.g. make train ARGS="--seed 1"
	$(VENV)/bin/flexarm train $(ARGS)

agent: $(HAS)-agent  ## Make the shipped agents anew: trainings, the median ones, their cards, the tables of docs
	$(PY) -m scripts.shipped $(ARGS)

learning: $(HAS)-plot  ## Show what learning gives beside classical laws: tables and pictures of finished trainings
	$(PY) -m scripts.learning $(ARGS)

evaluate: $(HAS)-train  ## Score the controllers, the shipped policy and trained runs
	$(VENV)/bin/flexarm evaluate $(ARGS)

leaderboard: $(HAS)-board  ## Measure every controller and agent on every axis; an entry of your own: docs/submit.md
	$(PY) -m scripts.leaderboard $(ARGS)

board-docs: $(HAS)-draw $(HAS)-agent  ## Bring all pages, laps and pictures up to date with the committed board
	$(PY) -m scripts.leaderboard --no-measure
	$(PY) -m scripts.docs.environments --no-pictures
	$(PY) -m scripts.shipped --no-train
	$(PY) -m scripts.learning --only delays shapes --docs
	$(PY) -m scripts.docs.replays
	$(PY) -m scripts.docs.pictures

bench: $(HAS)-bench  ## Measure the speed of simulation and environments beside their peers
	$(PY) -m scripts.benchmarks $(ARGS)

docs: reproduce validate $(HAS)-draw  ## Regenerate the pictures, tables and environment pages committed under docs/
	$(PY) -m scripts.docs.paper
	$(PY) -m scripts.docs.validation
	$(PY) -m scripts.analysis --docs
	$(PY) -m scripts.docs.environments
	$(PY) -m scripts.docs.replays
	$(PY) -m scripts.docs.pictures

site: $(HAS)-site  ## Build the site, pages and API reference, into build/site/
	$(PY) -m scripts.docs.site

dist: $(HAS)-dist  ## Build the wheel and the source archive into dist/, and check what the package index would refuse
	rm -rf dist
	$(PY) -m build
	$(PY) -m twine check --strict dist/*

lock:  ## Write the newest versions of all that verbs install into constraints.txt, for every Python and system
	$(ensure_venv)
	$(PY) -m pip install uv
	$(PY) -m uv pip compile pyproject.toml --extra dev --extra release --extra site --universal --python-version 3.11 \
		--upgrade --no-annotate --custom-compile-command "make lock" --quiet --output-file constraints.txt

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

install = $(PY) -m pip install -e ".[$(or $(1),$(error no EXTRAS_$* for $@))]" -c $(CONSTRAINTS)

$(HAS)-%: pyproject.toml $(CONSTRAINTS)
	$(ensure_venv)
	$(call install,$(EXTRAS_$*))$(if $(INSTEAD_$*), || $(call install,$(INSTEAD_$*)))
	@touch $@ $(addprefix $(HAS)-,$(COVERS_$*))
