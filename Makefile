# All commands run in .venv, which `make setup` prepares; PYTHON names the Python to make it with: unless told, that of
# the .venv that is there, else python3.
MADE_WITH := $(shell sed -n 's/^executable = //p' .venv/pyvenv.cfg 2>/dev/null)
PYTHON ?= $(if $(wildcard $(MADE_WITH)),$(MADE_WITH),python3)
ARGS ?=
BIN := .venv/bin

# What runs from here stays on this machine.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST

.PHONY: help setup demo test test-slow test-all lint bench docs labs firmware clean

PYTEST := $(BIN)/python -m pytest -n auto --dist=worksteal

help: ## Show this list (default)
	@sed -nE 's/^([a-z-]+):.*## (.*)/  make \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 18

setup: ## Create .venv with everything in it; where ROS 2 Jazzy is sourced, use that
	@command -v "$(PYTHON)" >/dev/null || { echo "setup: $(PYTHON) not found; to install: sudo apt-get install python3" >&2; exit 2; }
	@"$(PYTHON)" -m tools.setup_environment

demo: setup ## Bring up the simulated robot following a target; ARGS="..." goes to `tripod up --demo`
	@$(BIN)/tripod up --demo $(ARGS)

test: lint ## Lint, then test every behaviour once; ARGS="..." goes to pytest
	$(PYTEST) $(ARGS)

test-slow: setup ## Test what `make test` leaves out: whole matrices, labs, other programs, long fuzzing
	$(PYTEST) -m "slow or hypothesis" --hypothesis-profile=thorough $(ARGS)

test-all: test test-slow ## Both, then `make test` again with other kinds of arithmetic
	$(BIN)/python -m tools.arithmetic

lint: setup ## Check style, format and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy -n auto

bench: setup ## Time the steps of the simulator; ARGS="..." goes to the benchmark
	@$(BIN)/python benchmarks/step.py $(ARGS)

docs: setup ## Build the site of the documentation into build/site
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "docs: open build/site/index.html in a browser; search included, it needs no server"

labs: setup ## Open the notebooks of labs/ in the browser; installs JupyterLab the first time
	@$(BIN)/python -m pip install -q --disable-pip-version-check -c constraints.txt jupyterlab
	@$(BIN)/jupyter lab --config labs/jupyter_config.py labs

firmware: ## Build the firmware of the board and check its size; ARGS="WATCHDOG_MS=300" sets its parameters
	@$(MAKE) --no-print-directory -C firmware $(ARGS)

clean: ## Remove all that make has made, .venv included
	rm -rf .venv build firmware/build install log *.egg-info .ruff_cache .mypy_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
