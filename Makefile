# The commands that people and CI share. All run in a virtual environment made from the locked requirements.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo site page paper check test test-all mutants wheel bench lock clean
.DELETE_ON_ERROR:

# Trains a pursuer and an evader from nothing, in two to five minutes of a core; what they
# learned, and a report to open.
demo: $(VENV)/installed
	$(BIN)/apollonius train --preset quick --out runs/demo --force
	$(BIN)/apollonius report runs/demo
	@echo "To go on:"
	@echo "  $(BIN)/apollonius play --against demo/P_curriculum      flee from the pursuer that you have trained"
	@echo "  $(BIN)/apollonius show demo/P_curriculum flee           watch it hunt: game.gif"
	@echo "  $(BIN)/apollonius players                               who else can play"

# build/site: home, documents, reference, gallery, a report and the playground, for any web host.
site: $(VENV)/installed-site
	$(BIN)/python -m website --out build/site

# apollonius/web/page/compiled.js: what the page runs of the package (apollonius/web/programs.py), as WebAssembly. The
# compiler comes from ziglang, 85 MB that nothing else needs.
page: $(VENV)/installed-dev
	$(INSTALL) ziglang==0.17.1
	$(BIN)/python -m website.compiled

# Style and types.
check: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright --pythonpath $(BIN)/python

# Bytecode is kept: each process of the tests would else compile all that it imports.
unexport PYTHONDONTWRITEBYTECODE

# The files of tests are shared out between the cores. Types are checked beside them.
PYTEST := $(BIN)/python -m pytest --numprocesses $(shell getconf _NPROCESSORS_ONLN) --dist loadfile \
	--no-loadscope-reorder
test: $(VENV)/installed-dev
	$(MAKE) --jobs 2 check tests

.PHONY: tests
tests:
	$(PYTEST)

# With those that take long, and those that compare with other people's code, which is installed for it: on Linux with
# PyTorch and the CUDA that it brings, some 5 GB.
test-all: check $(VENV)/installed-site $(VENV)/installed-peers
	$(PYTEST) -m ""

# How many small changes of the code the tests notice: some hours; a second call goes on.
mutants: $(VENV)/installed-dev
	$(INSTALL) cosmic-ray==8.7.0
	$(BIN)/python tests/mutants.py --mutants 200 --out mutants.jsonl

# dist/apollonius-*.whl and dist/apollonius-*.tar.gz
wheel: $(VENV)/installed
	$(BIN)/python -m hatchling build --clean

# Every figure and table of the paper, some 70 minutes of a core for each seed; BUDGET=quick takes minutes. A second
# call goes on where the first one was stopped.
BUDGET ?= paper
SEEDS ?= 3
paper: $(VENV)/installed
	$(BIN)/apollonius reproduce --budget $(BUDGET) --seeds $(SEEDS) --out runs/paper --resume

bench: $(VENV)/installed-dev
	$(BIN)/python benchmarks/speed.py env
	$(BIN)/python benchmarks/speed.py train
	$(BIN)/python benchmarks/speed.py train --profile fast
	taskset -c 0 $(BIN)/python benchmarks/speed.py solve

# Hashes and no addresses: one file serves every Python from 3.11 on.
LOCK := uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate --no-header \
	--no-emit-index-url --no-emit-find-links --extra build --extra plot --extra gym pyproject.toml
lock:
	$(LOCK) --output-file requirements.lock
	$(LOCK) --constraint requirements.lock --extra dev --output-file requirements-dev.lock
	$(LOCK) --constraint requirements-dev.lock --extra site --output-file requirements-site.lock
	$(LOCK) --constraint requirements-dev.lock --constraint requirements-site.lock --extra dev --extra peers \
		--output-file requirements-peers.lock

clean:
	rm -rf $(VENV) dist build .jax_cache .pytest_cache .ruff_cache .hypothesis

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

# What is never imported need not be compiled: it takes half of the time.
INSTALL := $(BIN)/python -m pip install --quiet --no-compile
$(VENV)/installed: requirements.lock pyproject.toml | $(VENV)/bin/python
	$(INSTALL) --require-hashes -r requirements.lock
	$(INSTALL) --no-deps --no-build-isolation --editable .
	touch $@

$(VENV)/installed-dev: requirements-dev.lock $(VENV)/installed
	$(INSTALL) --require-hashes -r requirements-dev.lock
	touch $@

$(VENV)/installed-site: requirements-site.lock $(VENV)/installed
	$(INSTALL) --require-hashes -r requirements-site.lock
	touch $@

$(VENV)/installed-peers: requirements-peers.lock $(VENV)/installed-dev
	$(INSTALL) --require-hashes -r requirements-peers.lock
	touch $@
