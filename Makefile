# Shipshape's commands; `make` lists them. Needs Python 3.11 with pip and venv, and nothing else.
PYTHON ?= $(or $(shell command -v python3.11 2>/dev/null),python3)
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# Builds this checkout in place with the locked tools: nothing is downloaded, and nothing but it is installed.
EDITABLE := $(PIP) install --no-build-isolation --no-deps --no-index

CONSOLE := service/shipshape/console/static/index.html

.DEFAULT_GOAL := help
.PHONY: help demo serve setup test check fmt lint types arch gen gen-check docs train torch clients console lock hooks \
  image

help: ## list these commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: $(VENV)/.service ## start the service, send it a scan as a client would, print a table and write pictures
	@$(BIN)/python examples/demo.py

serve: $(VENV)/.service $(CONSOLE) ## run the service on loopback until Ctrl-C
	@$(BIN)/shipshape serve

setup: $(VENV)/.dev $(CONSOLE) ## create .venv with everything but torch

test: $(VENV)/.dev $(VENV)/.clients $(CONSOLE) ## run the whole suite, but the training tests only after `make torch`
	@$(BIN)/python -m pytest -n 2

check: lint types arch gen-check test ## everything a change must pass

fmt: $(VENV)/.dev ## format, and fix what can be fixed
	@$(BIN)/ruff check --fix-only --quiet
	@$(BIN)/ruff format

lint: $(VENV)/.dev ## style and format
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check

types: $(VENV)/.dev ## mypy --strict on the service
	@$(BIN)/mypy

arch: $(VENV)/.dev ## who may import whom
	@$(BIN)/lint-imports

gen: $(VENV)/.dev ## write the gRPC stubs again from proto/
	@PYTHON=$(BIN)/python sh proto/generate.sh

gen-check: $(VENV)/.dev ## the gRPC stubs are those of proto/
	@fresh=$$(mktemp -d) && trap 'rm -rf "$$fresh"' EXIT && PYTHON=$(BIN)/python sh proto/generate.sh "$$fresh" && \
	for stub in "$$fresh"/shipshape/*/*; do \
	  diff "$$stub" "service/$${stub#"$$fresh"/}" || { echo "make gen-check: expected the stubs of proto/, got others: run make gen" >&2; exit 1; }; \
	done

docs: $(VENV)/.dev ## build the documentation as a site in out/site; open its index.html
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

train: torch ## make the default bundle in the lab: data sets, networks, ONNX, manifest
	@$(BIN)/shipshape-lab train --work runs --to models

torch: $(VENV)/.dev ## add torch, which only the lab and its tests use
	@$(BIN)/python -c 'import torch' 2>/dev/null || $(PIP) install --requirement requirements/torch.txt

clients: $(VENV)/.clients ## install the clients of other makers that the tests use, apart: they need older packages

console: ## build the page that the service serves at /; needs Node.js with npm
	@sh console/build.sh

hooks: $(VENV)/.dev ## run the quick checks before each of your commits
	@$(BIN)/pre-commit install

image: ## build the container image and hold it to its promises, with docker or podman
	@deploy/prove_image.sh

LOCK = UV_CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/uv pip compile --quiet --universal --python-version 3.11 \
  --generate-hashes --no-annotate --no-emit-index-url --no-emit-find-links

lock: $(VENV)/.dev ## resolve requirements/*.lock again from the pyproject files
	@$(LOCK) pyproject.toml requirements/build.in --extra otel --output-file requirements/service.lock
	@$(LOCK) pyproject.toml lab/pyproject.toml requirements/build.in requirements/dev.in --extra loadtest --extra otel \
	  --constraint requirements/service.lock --no-emit-package shipshape --output-file requirements/dev.lock
	@$(LOCK) requirements/clients.in --output-file requirements/clients.lock

# A stamp is older than its lock only when the lock changed: the second time, nothing is asked of the network.
$(VENV)/.service: requirements/service.lock pyproject.toml | $(BIN)/python
	@echo "installing what requirements/service.lock pins"
	@$(PIP) install --require-hashes --requirement requirements/service.lock
	@$(EDITABLE) --editable .
	@touch $@

$(VENV)/.dev: requirements/dev.lock lab/pyproject.toml $(VENV)/.service
	@echo "installing what requirements/dev.lock pins"
	@$(PIP) install --require-hashes --requirement requirements/dev.lock
	@$(EDITABLE) --editable lab
	@touch $@

$(VENV)/.clients: requirements/clients.lock | $(BIN)/python
	@echo "installing what requirements/clients.lock pins"
	@$(BIN)/python -m venv --clear $(VENV)/clients
	@$(VENV)/clients/bin/python -m pip --disable-pip-version-check --quiet install --no-deps --require-hashes \
	  --requirement requirements/clients.lock
	@touch $@

# Left out where it cannot be built: the service does without it, and says so at /.
$(CONSOLE): $(wildcard console/package-lock.json console/build.* console/src/* console/src/*/* console/public/* console/public/*/*)
	@sh console/build.sh || echo "make: / will have no page, everything else works; make console tries again"

$(BIN)/python:
	@$(PYTHON) -c '' 2>/dev/null || \
	  { echo "make: expected Python 3.11 as python3.11, python3 or PYTHON=..., found none that starts" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "make: expected Python 3.11 or newer, got $$($(PYTHON) --version): name one with PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "make: expected Python's venv and pip modules, found none: on Debian, apt install python3-venv" >&2; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }
