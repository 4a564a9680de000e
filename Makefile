# GeoDerm. `make demo` shows it, `make test` proves it; both set everything up first.
.DEFAULT_GOAL := help
.PHONY: help setup demo run test check format bench screenshots lock clean

PYTHON := .venv/bin/python

help: ## What can be made here
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 14

setup: ## Install system packages and create .venv with the geoderm command
	@.setup/system-packages
	@.setup/environment

demo: setup ## Open the demonstration clinic; without a screen, run it and leave the results in demo-output/
	@if [ -n "$$DISPLAY$$WAYLAND_DISPLAY" ]; then .venv/bin/geoderm demo; \
	else .setup/virtual-screen .venv/bin/geoderm demo --unattended --out demo-output; fi

run: setup ## Open the application
	@.venv/bin/geoderm run

test: setup ## Run the test suite
	@.setup/test-packages
	@$(PYTHON) -m pytest -q -n 2 --dist loadfile tests --ignore=tests/gui --ignore=tests/benchmarks
	@.setup/virtual-screen $(PYTHON) -m pytest -q tests/gui

check: setup ## Lint, type-check and guard the floors
	@$(PYTHON) -m ruff check .
	@$(PYTHON) -m ruff format --check .
	@$(PYTHON) -m mypy
	@.venv/bin/lint-imports

format: setup ## Format the code
	@$(PYTHON) -m ruff check --fix-only .
	@$(PYTHON) -m ruff format .

bench: setup ## Measure every claimed figure into docs/benchmarks/
	@.setup/virtual-screen $(PYTHON) -m tests.benchmarks

screenshots: setup ## Make the pictures of the user guide anew
	@.setup/virtual-screen .venv/bin/geoderm demo --unattended --out demo-output --guide docs/pictures

lock: ## Resolve requirements.lock anew (needs uv)
	uv pip compile --universal --python-version 3.11 --override requirements-overrides.txt requirements-dev.in \
	    --generate-hashes --no-annotate --no-header --output-file requirements.lock

clean: ## Remove the environment and everything generated
	rm -rf .venv demo-output build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
