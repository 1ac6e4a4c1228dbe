# `make` lists the targets. Each does all the set-up that it needs.
SHELL := /bin/bash
.DEFAULT_GOAL := help

STUDY ?= studies/figure3.toml
NP ?= 1
PYTEST_ARGS ?=
PEERS_ARGS ?=
LOOP_ARGS ?=

# A selection of tests may hold none for 2 ranks (pytest's status 5); the whole suite may not.
NONE_OK = $(if $(PYTEST_ARGS),|| [ $$? -eq 5 ])

PYTHON := .venv/bin/python
EPSMESH := .venv/bin/epsmesh
# One thread a rank; Open MPI asks before it runs as root, or on more ranks than there are cores.
MPI_ENV := OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
# Debian's own mpirun: another one on PATH would not fit Debian's mpi4py.
MPIRUN = $(MPI_ENV) /usr/bin/mpirun --oversubscribe -n

.PHONY: help setup study studies test test-debian13 verify benchmark peers plain-loop stress lint format clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: ## install what is missing (root or sudo for Debian's packages)
	@scripts/setup.sh

study: setup ## run one study: make study STUDY=studies/quick.toml NP=2
ifeq ($(NP),1)
	$(EPSMESH) run $(STUDY)
else
	$(MPIRUN) $(NP) $(EPSMESH) run $(STUDY)
endif

studies: setup ## run every study in studies/
	$(EPSMESH) run studies/*.toml

test: setup ## run the tests, serial and on 2 ranks
	$(PYTHON) -m pytest $(PYTEST_ARGS) </dev/null
	$(MPIRUN) 2 scripts/one-voice.sh $(PYTHON) -m mpi4py -m pytest -m mpi -p no:cacheprovider $(PYTEST_ARGS) </dev/null $(NONE_OK)

test-debian13: ## run the tests on Debian 13, in a root of its own (needs root)
	@scripts/test-debian13.sh

verify: setup ## forces against closed forms, tables and the program's other paths
	$(EPSMESH) verify

benchmark: setup ## work against precision: results/work_precision.nc and its figure (an idle machine, 10 minutes)
	$(EPSMESH) benchmark

peers: setup ## NGSolve and scikit-fem against this program, time to a true error (an idle machine): results/peers.md
	@scripts/peers.sh
	$(PYTHON) -m benchmarks.peers $(PEERS_ARGS)

plain-loop: setup ## a study as a plain FEniCSx script runs it, against this program (idle, an hour or two)
	$(PYTHON) -m benchmarks.plain_loop $(STUDY) $(LOOP_ARGS)

stress: setup ## numerical stability: a matrix of extremes (10 minutes)
	$(EPSMESH) stress

lint: setup ## ruff, mypy and the layers of the imports
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy
	.venv/bin/lint-imports

format: setup ## let ruff mend and format
	.venv/bin/ruff check --fix
	.venv/bin/ruff format

clean: ## remove caches and the venv; results stay
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .import_linter_cache *.egg-info
	find . -name __pycache__ -type d -not -path './.cache/*' -prune -exec rm -rf {} +
