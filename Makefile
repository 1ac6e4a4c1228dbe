# `make` lists the targets. Each does all the set-up that it needs.
SHELL := /bin/bash
.DEFAULT_GOAL := help

STUDY ?= studies/figure3.toml
NP ?= 1
PYTEST_ARGS ?=
SUITE ?= trixie
GOALS ?= setup
PEERS_ARGS ?=
FUZZ ?= 5000
LOOP_ARGS ?=
SOAK_ARGS ?=
STRESS_ARGS ?=
COVERAGE_ARGS ?=
FAULTS_ARGS ?=
MUTANTS_ARGS ?=

# A selection of tests may hold none for 2 ranks (pytest's status 5); the whole suite may not.
NONE_OK = $(if $(PYTEST_ARGS),|| [ $$? -eq 5 ])

# A process of tests a core, each with whole files of them: what a file's tests share is made once.
SIDE_BY_SIDE := -n logical --maxprocesses 8 --dist loadfile

# Large arrays on huge pages, where the C library is asked for them: a tenth of a run's time (docs/performance.md).
export GLIBC_TUNABLES ?= glibc.malloc.hugetlb=1

DOCS := docs/_build/html
PYTHON := .venv/bin/python
EPSMESH := .venv/bin/epsmesh
# One thread a rank; Open MPI asks before it runs as root, or on more ranks than there are cores.
MPI_ENV := OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
# Debian's own mpirun: another one on PATH would not fit Debian's mpi4py.
MPIRUN = $(MPI_ENV) /usr/bin/mpirun --oversubscribe -n

.PHONY: help setup study studies docs test test-all test-debian13 debian docker-steps release slurm-test verify benchmark peers plain-loop realtime resolution stress coverage pairs fuzz soak faults mutants lint format clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: ## install what is missing (root or sudo for Debian's packages); EXTRAS=view: pictures of cases, too
	@scripts/setup.sh

study: setup ## run one study: make study STUDY=studies/quick.toml NP=2
ifeq ($(NP),1)
	$(EPSMESH) run $(STUDY)
else
	$(MPIRUN) $(NP) $(EPSMESH) run $(STUDY)
endif

studies: setup ## run every study in studies/
	$(EPSMESH) run studies/*.toml

docs: setup ## build the documentation; a warning is an error
	$(PYTHON) -m sphinx -W --keep-going -n -q -E -a -b html docs $(DOCS)
	@echo $(DOCS)/index.html

# The browser is for the tests of the report alone, which are left out where there is none.
test: ## run the tests, by themselves and on 2 ranks
	@scripts/setup.sh chromium
	$(PYTHON) -m pytest $(SIDE_BY_SIDE) $(PYTEST_ARGS) </dev/null
	$(MPIRUN) 2 scripts/one-voice.sh $(PYTHON) -m mpi4py -m pytest -m "mpi and not nightly" -p no:cacheprovider $(PYTEST_ARGS) </dev/null $(NONE_OK)

test-all: ## run the tests with those that are left to the night
	@scripts/setup.sh chromium
	$(PYTHON) -m pytest $(SIDE_BY_SIDE) -m "not slurm" $(PYTEST_ARGS) </dev/null
	$(MPIRUN) 2 scripts/one-voice.sh $(PYTHON) -m mpi4py -m pytest -m mpi -p no:cacheprovider $(PYTEST_ARGS) </dev/null $(NONE_OK)

test-debian13: ## run the tests on Debian 13, in a root of its own (needs root)
	@scripts/test-debian13.sh

debian: ## run other targets on another Debian, in a root of its own (needs root): make debian SUITE=sid GOALS=realtime
	@DEBIAN_SUITE=$(SUITE) GOALS="$(GOALS)" scripts/test-debian13.sh

docker-steps: ## run the steps of the Dockerfile in a root of Debian 12 (needs root)
	@DEBIAN_SUITE=bookworm STEPS=Dockerfile scripts/test-debian13.sh

release: ## build sdist and wheel into dist/, install both, and run a study from there
	@scripts/setup.sh
	@scripts/release.sh

slurm-test: setup ## run the job scripts on a Slurm of two virtual nodes, installed and started here (needs root)
	$(PYTHON) -m pytest -m slurm $(PYTEST_ARGS) </dev/null

verify: setup ## forces against closed forms, tables and the program's other paths
	$(EPSMESH) verify

benchmark: setup ## every table of docs/performance.md, into results/ (an idle machine, half an hour)
	@scripts/peers.sh
	$(PYTHON) -m benchmarks.start_up
	$(PYTHON) -m benchmarks.ranks
	$(PYTHON) -m benchmarks.communication
	$(PYTHON) -m benchmarks.peers
	$(PYTHON) -m benchmarks.plain_loop --sample 24
	$(PYTHON) -m benchmarks.shares
	$(PYTHON) -m benchmarks.products
	$(PYTHON) -m benchmarks.solvers
	$(PYTHON) -m benchmarks.contact
	$(PYTHON) -m benchmarks.organs
	$(PYTHON) -m benchmarks.paths
	$(PYTHON) -m benchmarks.scaling
	$(PYTHON) -m benchmarks.work_precision
	$(EPSMESH) run studies/speedup.toml --fresh

peers: setup ## NGSolve and scikit-fem against this program, time to a true error (an idle machine): results/peers.md
	@scripts/peers.sh
	$(PYTHON) -m benchmarks.peers $(PEERS_ARGS)

plain-loop: setup ## a study as a plain FEniCSx script runs it, against this program, with and without reductions (idle, an hour or two)
	$(PYTHON) -m benchmarks.plain_loop $(STUDY) $(LOOP_ARGS)

realtime: setup ## the real-time evaluator: a shared library, and its tests in C, C++, Python and under sanitizers
	$(CC) -std=c99 -O2 -Wall -Wextra -pedantic -fPIC -shared realtime/epsmesh_patch.c -o realtime/libepsmesh.so -lm
	$(CC) -std=c99 -O2 -Wall -Wextra -pedantic realtime/epsmesh_patch.c realtime/latency.c -o realtime/latency -lm
	$(PYTHON) -m pytest tests/realtime $(PYTEST_ARGS)

resolution: setup ## what a file's resolution, noise and voxels change of F (a quarter of an hour): results/resolution.png
	$(MPI_ENV) $(PYTHON) -m benchmarks.resolution

stress: setup ## numerical stability: a matrix of extremes (10 minutes; STRESS_ARGS="poisson layer": rows of these names)
	$(PYTHON) -m benchmarks.stress $(STRESS_ARGS)

coverage: setup ## do the error bars hold on 160 random scenes? COVERAGE_ARGS="--family tools --count 60 --seed 7": others
	$(PYTHON) -m benchmarks.coverage $(COVERAGE_ARGS)

fuzz: setup ## ten thousand study files, and damaged surfaces, datasets, stores and models (minutes)
	EPSMESH_FUZZ=$(FUZZ) $(MPI_ENV) $(PYTHON) -m pytest tests/fuzz -q $(PYTEST_ARGS)

pairs: setup ## every feature of a study alone and with every other: taken, or refused with the reason: results/pairs.md
	$(MPI_ENV) nice $(PYTHON) -m tests.pairs

soak: setup ## 20,000 cases on 2,000 meshes in one run: memory and pace stay flat (a quarter of an hour; SOAK_ARGS=2000: a part)
	$(MPI_ENV) $(PYTHON) -m benchmarks.soak $(SOAK_ARGS)

faults: setup ## runs killed at a hundred moments: nothing finished is lost (a quarter of an hour; FAULTS_ARGS=20: fewer)
	$(MPI_ENV) $(PYTHON) -m benchmarks.faults $(FAULTS_ARGS)

mutants: setup ## random wrong numbers, are they noticed? (nightly, hours; MUTANTS_ARGS='--seed 2 --room solve'): results/mutants.md
	$(MPI_ENV) $(PYTHON) -m benchmarks.mutants $(MUTANTS_ARGS)

lint: setup ## ruff, mypy and the layers of the imports
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy
	.venv/bin/lint-imports

format: setup ## let ruff mend and format
	.venv/bin/ruff check --fix
	.venv/bin/ruff format

clean: ## remove caches and the venv; results stay
	rm -rf docs/_build docs/reference .venv .pytest_cache .mypy_cache .ruff_cache .import_linter_cache *.egg-info
	find . -name __pycache__ -type d -not -path './.cache/*' -prune -exec rm -rf {} +
