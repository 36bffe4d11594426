# Every target makes its own environment in .venv; nothing else on the machine is touched.
PYTHON ?= python3
# Extra arguments for pip, for instance the index that serves the CUDA build of torch you want.
PIP_ARGS ?=
SIMULATORS ?= esim v2e pix2nvs
# Trainings side by side: two that share the cores finish sooner than one after the other.
JOBS ?= 2
VENV := .venv
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install study test faults lint format

help: ## List the targets
	@grep -E '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  make \1|\2/' | column -t -s '|'

install: $(INSTALLED) ## Create .venv and install the package with the tested versions

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.12")'
	@echo "installing into $(VENV), which takes a few minutes"
	@start=$$(date +%s) \
	&& $(PYTHON) -m venv $(VENV) \
	&& $(VENV)/bin/python -m pip install --quiet $(PIP_ARGS) -c constraints.txt -e '.[all,dev]' \
	&& echo $$(($$(date +%s) - start)) > $@

study: install ## Run the whole study on dsec_mini: generate, simulate, train, score, report
	@$(VENV)/bin/python scripts/prepare.py
	@printf '%s\n' real $(SIMULATORS) | xargs -P $(JOBS) -I{} $(VENV)/bin/python train.py sim={} \
		jobs=$(JOBS) callbacks=lines
	@$(VENV)/bin/python evaluate.py --eqs
	@printf '  %-24s%8.1f s\n' install "$$(cat $(INSTALLED))"

test: install ## Run the tests
	$(VENV)/bin/python -m pytest

faults: install ## Kill commands, start them twice and fill the disk, many times over: hours
	EQS_FAULT_KILLS=18 EQS_FAULT_PAIRS=20 $(VENV)/bin/python -m pytest tests/faults

lint: install ## Check style, types and formatting
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

format: install ## Format the code and sort imports
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .
