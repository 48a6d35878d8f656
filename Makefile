# Everything on a fresh Debian or Ubuntu with Python 3.11, make and git: `make demo`, `make test`.
SHELL := /bin/bash
PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
INSTALL := $(BIN)/pip install --quiet -c constraints.txt
TORCH := $(shell sed -n 's/^torch==//p' constraints.txt)
# Of `make reproduce`.
SCALE ?= 0.02
OUT ?= reproduction
# The CPU build of torch is 200 MB instead of several GB; a machine with an NVIDIA GPU gets CUDA's.
TORCH_CPU_INDEX := https://download.pytorch.org/whl/cpu
# What Open3D needs to be imported, and what Rerun needs to draw without a screen.
LIBRARIES := libusb-1.0-0 libgl1 libegl1 libgomp1 mesa-vulkan-drivers libxkbcommon0 \
	libxkbcommon-x11-0 libwayland-client0 libxcursor1 libxi6 libxrandr2

# Install those of some Debian packages that are missing, or say which command does.
define provide
missing=""; for package in $(1); do \
	dpkg-query -W -f='$${Status}' $$package 2>/dev/null | grep -q "ok installed" || missing="$$missing $$package"; \
done; \
command="apt-get install -y --no-install-recommends$$missing"; \
if [ -z "$$missing" ]; then true; \
elif ! command -v apt-get >/dev/null; then echo "Not a Debian or Ubuntu: install what corresponds to$$missing"; \
elif [ "$$(id -u)" = 0 ]; then \
	(apt-get update -qq && DEBIAN_FRONTEND=noninteractive $$command -qq >/dev/null) || echo "That failed; run: $$command"; \
elif sudo -n true 2>/dev/null; then \
	(sudo apt-get update -qq && sudo DEBIAN_FRONTEND=noninteractive $$command -qq >/dev/null) || echo "That failed; run: sudo $$command"; \
else echo "Run: sudo $$command"; fi
endef

.DEFAULT_GOAL := help
.PHONY: help setup develop libraries demo reproduce test slow coverage check format lint type mypy pyright layers docs benchmark build clean

help: ## Say what there is
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 12

setup: $(VENV)/.run libraries ## Make .venv with what dnet needs to run; again: nothing

$(VENV)/.run: pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is not here: apt-get install python3.11 python3.11-venv, or make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c "import ensurepip" 2>/dev/null || { $(call provide,python3.11-venv); }
	test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV)
	@if command -v nvidia-smi >/dev/null && nvidia-smi -L >/dev/null 2>&1; then \
		$(INSTALL) "torch==$(TORCH)"; \
	else \
		$(INSTALL) "torch==$(TORCH)+cpu" 2>/dev/null \
		|| $(INSTALL) --extra-index-url $(TORCH_CPU_INDEX) "torch==$(TORCH)+cpu" \
		|| $(INSTALL) "torch==$(TORCH)"; \
	fi
	$(INSTALL) -e .
	@touch $@

$(VENV)/.report: $(VENV)/.run
	$(INSTALL) -e ".[report]"
	@touch $@

$(VENV)/.docs: $(VENV)/.run
	$(INSTALL) -e ".[docs]"
	@touch $@

# Python compiles what tests import when they do; pip would compile, and write, everything.
$(VENV)/.develop: $(VENV)/.run
	$(INSTALL) --no-compile -e ".[dev]"
	@touch $@ $(VENV)/.docs

develop: setup $(VENV)/.develop ## The same, and what its tests and checks need

libraries: ## Install the system libraries of Open3D and Rerun, or say what to run
	@$(call provide,$(LIBRARIES))

demo: setup ## Record, train, servo and play on a small scale; results in demo/
	$(BIN)/dnet demo

reproduce: setup $(VENV)/.report ## The paper from nothing, on SCALE of its work; results in OUT
	$(BIN)/dnet reproduce --scale $(SCALE) --out $(OUT)

test: develop ## Run the checks and the tests
	$(MAKE) --no-print-directory --jobs=2 --output-sync=target check
	$(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile

slow: develop ## Run the tests that take minutes each, which `make test` leaves out
	$(BIN)/python -m pytest -m slow

coverage: develop ## Run the tests and say which lines of the code they never reach
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

check: lint type layers docs ## Run the static checks

format: ## Format the code
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lint:
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

type: mypy pyright

mypy:
	$(BIN)/mypy

pyright:
	$(BIN)/pyright --pythonpath $(BIN)/python

layers:
	$(BIN)/lint-imports

docs: $(VENV)/.docs ## Build the documentation into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

benchmark: develop ## Measure how fast the laboratory is, as ratios
	$(BIN)/python -m tests.benchmarks.laboratory --workers

build: develop ## Build the wheel and the sdist into dist/
	$(BIN)/python -m build

clean: ## Remove .venv, build products and caches
	rm -rf $(VENV) build dist site *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
