# Every target makes its own environment in .venv; nothing else on the machine is touched.
PYTHON ?= python3
# Extra arguments for pip, for instance the index that serves the CUDA build of torch you want.
PIP_ARGS ?=
SIMULATORS ?= esim,v2e,pix2nvs
VENV := .venv
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install study test lint format

help: ## List the targets
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  make \1|\2/' | column -t -s '|'

install: $(INSTALLED) ## Create .venv and install the package with the tested versions

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet $(PIP_ARGS) -c constraints.txt -e '.[dev]'
	@touch $@

study: install ## Run the whole study on dsec_mini: generate, simulate, train, score, report
	@$(VENV)/bin/python train.py -m sim=real,$(SIMULATORS) ckpt_path=last
	@$(VENV)/bin/python evaluate.py --eqs

test: install ## Run the tests
	$(VENV)/bin/python -m pytest

lint: install ## Check style, types and formatting
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

format: install ## Format the code and sort imports
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .
