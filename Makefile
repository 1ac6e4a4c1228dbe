# `make` lists the targets. Each does all the set-up that it needs.
SHELL := /bin/bash
.DEFAULT_GOAL := help

STUDY ?= studies/figure3.toml
NP ?= 1
PYTEST_ARGS ?=
SUITE ?= trixie
STAGE ?= epsmesh
GOALS ?= setup
PEERS_ARGS ?=
ENGINES_ARGS ?=
FUZZ ?= 5000
FUZZ_MODELS ?= 100000
LOOP_ARGS ?=
SOAK_ARGS ?=
SAME_ARGS ?= --seeds 0:300
STRESS_ARGS ?=
COVERAGE_ARGS ?=
REFIT_ARGS ?=
FAULTS_ARGS ?=
MUTANTS_ARGS ?=

# A selection of tests may have none for one rank or for 2 (pytest's status 5); the whole suite may not.
NONE_OK = $(if $(PYTEST_ARGS),|| [ $$? -eq 5 ])

# One test process per core, each with whole files, so that a file's fixtures are made once; the slowest files first.
# One thread of BLAS in each, as in runs: idle ones spin, and would take half of the cores.
SIDE_BY_SIDE := -n logical --maxprocesses 8 --dist loadfile --no-loadscope-reorder
TESTS = OMP_NUM_THREADS=1 $(PYTHON) -m pytest $(SIDE_BY_SIDE)
# Suites that no change concerns are not run by day, unless asked for by their path.
UNCONCERNED = $(if $(findstring tests/,$(PYTEST_ARGS)),,$$($(PYTHON) -m tests.suites))

# Tests and documentation start hundreds of processes: each would compile the package again.
unexport PYTHONDONTWRITEBYTECODE

# Huge pages for large arrays.
export GLIBC_TUNABLES ?= glibc.malloc.hugetlb=1

DOCS := docs/_build/html
PYTHON := .venv/bin/python
EPSMESH := .venv/bin/epsmesh
# One thread per rank. Open MPI refuses by default to run as root, or on more ranks than cores.
MPI_ENV := OMP_NUM_THREADS=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
# Debian's mpirun: another one on PATH does not match Debian's mpi4py.
MPIRUN = $(MPI_ENV) /usr/bin/mpirun --oversubscribe -n

.PHONY: help setup study studies docs test test-all test-debian13 debian docker-steps release wheel-road slurm-test verify benchmark peers engines hosts plain-loop realtime wasm vendored stress extremes coverage refit pairs same fuzz soak faults mutants lint format clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: ## install everything (root or sudo for Debian's packages)
	@scripts/setup.sh

# Without the packages for tests and documentation, which take as long to install as all others.
study: ## run one study: make study STUDY=studies/quick.toml NP=2
	@EXTRAS=run scripts/setup.sh
ifeq ($(NP),1)
	$(EPSMESH) run $(STUDY)
else
	$(MPIRUN) $(NP) $(EPSMESH) run $(STUDY)
endif

studies: setup ## run every study in studies/
	$(EPSMESH) run $(filter-out studies/identify-%,$(wildcard studies/*.toml))
	$(EPSMESH) identify studies/identify-*.toml

docs: setup ## build the documentation; a warning is an error
	$(PYTHON) -m sphinx -W --keep-going -n -q -E -a -b html docs $(DOCS)
	@echo $(DOCS)/index.html

test: ## run the day's tests: those with the marker `mpi` on 2 ranks, the others side by side on one each
	@scripts/setup.sh
	$(TESTS) -m "not slurm and not nightly and not mpi" $(UNCONCERNED) $(PYTEST_ARGS) </dev/null $(NONE_OK)
	$(MPIRUN) 2 scripts/one-voice.sh $(PYTHON) -m mpi4py -m pytest -m "mpi and not nightly" -p no:cacheprovider \
		$(UNCONCERNED) $(PYTEST_ARGS) </dev/null $(NONE_OK)

# Only the tests of pages need a browser; without one they are skipped.
test-all: ## run all tests, with the long ones (marker `nightly`) and all suites
	@scripts/setup.sh chromium
	$(TESTS) -m "not slurm" $(PYTEST_ARGS) </dev/null
	$(MPIRUN) 2 scripts/one-voice.sh $(PYTHON) -m mpi4py -m pytest -m mpi -p no:cacheprovider $(PYTEST_ARGS) </dev/null $(NONE_OK)

test-debian13: ## run the tests on Debian 13, in a chroot (needs root)
	@scripts/test-debian13.sh

debian: ## run other targets on another Debian, in a chroot (needs root): make debian SUITE=sid GOALS=realtime
	@DEBIAN_SUITE=$(SUITE) GOALS="$(GOALS)" scripts/test-debian13.sh

docker-steps: ## run the Dockerfile's lines and a small study in a chroot (needs root); STAGE=lab with JupyterLab
	@STEPS=Dockerfile STAGE=$(STAGE) scripts/test-debian13.sh

release: ## build sdist and wheel into dist/, install both, and run a study with each
	@scripts/setup.sh
	@scripts/release.sh

wheel-road: ## install and run without root and Debian's packages, from the wheel alone (skipped without Python >= 3.12; WHEEL_PYTHON=...)
	@scripts/wheel-road.sh

slurm-test: setup ## install and start a Slurm of two virtual nodes here, and run the job scripts on it (needs root)
	$(PYTHON) -m pytest -m slurm $(PYTEST_ARGS) </dev/null

verify: setup ## compare forces with closed forms, published tables and other ways through the program (minutes)
	$(PYTHON) -m tests.verification

benchmark: setup ## make the tables of docs/why/performance.md in results/ (on an idle machine, one to two hours)
	@scripts/peers.sh
	$(PYTHON) -m benchmarks.start_up
	$(PYTHON) -m benchmarks.ranks
	$(PYTHON) -m benchmarks.peers
	$(PYTHON) -m benchmarks.asked
	$(PYTHON) -m benchmarks.plain_loop --sample 24
	$(PYTHON) -m benchmarks.huge
	$(PYTHON) -m benchmarks.speedup
	$(PYTHON) -m benchmarks.shares
	$(PYTHON) -m benchmarks.solvers
	$(PYTHON) -m benchmarks.contact
	$(PYTHON) -m benchmarks.large
	$(PYTHON) -m benchmarks.organs
	$(PYTHON) -m benchmarks.paths
	$(PYTHON) -m benchmarks.influence
	$(PYTHON) -m benchmarks.spread
	$(PYTHON) -m benchmarks.posture
	$(PYTHON) -m benchmarks.work_precision
	$(PYTHON) -m benchmarks.drag --minutes 5

peers: setup ## compare with NGSolve, scikit-fem and CalculiX the time for a true error, with NGSolve error bars (on an idle machine)
	@scripts/peers.sh
	$(PYTHON) -m benchmarks.peers $(PEERS_ARGS)
	$(PYTHON) -m benchmarks.peers.contacts
	$(PYTHON) -m benchmarks.strangers

engines: setup ## compare the force on a ball in a pad with those of MuJoCo, Newton and PyBullet (an hour): results/engines.md
	@scripts/engines.sh
	$(PYTHON) -m benchmarks.engines $(ENGINES_ARGS)

hosts: setup ## test the functions for PyTorch and JAX, and the examples for MuJoCo and Newton, in a venv of their own
	@scripts/engines.sh
	PYTHONPATH=.:pipeline .venv-engines/bin/python -m pytest --noconftest -m "" \
		$(foreach host,of_torch of_jax mujoco newton,tests/realtime/test_$(host).py) $(PYTEST_ARGS)

plain-loop: setup ## compare a plain FEniCSx script of a study with this program (on an idle machine, an hour or two)
	$(PYTHON) -m benchmarks.plain_loop $(STUDY) $(LOOP_ARGS)

realtime: setup ## build the real-time evaluator in C; test it in C, C++ and Python, and with sanitizers
	$(CC) -std=c99 -O2 -Wall -Wextra -pedantic -fPIC -shared pipeline/epsmesh_realtime/c/epsmesh.c -o pipeline/epsmesh_realtime/c/libepsmesh.so -lm
	$(CC) -std=c99 -O2 -Wall -Wextra -pedantic pipeline/epsmesh_realtime/c/epsmesh.c pipeline/epsmesh_realtime/c/latency.c -o pipeline/epsmesh_realtime/c/latency -lm
	$(PYTHON) -m pytest tests/realtime $(PYTEST_ARGS)

wasm: ## build the evaluator for the page of `epsmesh touch`, after a change of its sources (installs clang and lld)
	@scripts/setup.sh clang lld
	$(PYTHON) pipeline/epsmesh_realtime/wasm/build.py

vendored: setup ## fetch the JavaScript of others again, with npm, as scripts/vendored.toml records it
	$(PYTHON) scripts/vendored.py

stress: setup ## extreme values of every input (10 minutes; STRESS_ARGS="poisson layer" selects rows)
	$(PYTHON) -m benchmarks.stress $(STRESS_ARGS)

extremes: setup ## extreme values in random scenes, against finer solutions (hours; EXTREMES_ARGS="--minutes 10", then again)
	$(MPI_ENV) $(PYTHON) -m benchmarks.extremes $(EXTREMES_ARGS)

coverage: setup ## how often error bars cover the error, on 1,000 random scenes of every feature (hours; COVERAGE_ARGS="--minutes 10", then again)
	$(MPI_ENV) $(PYTHON) -m benchmarks.bars $(COVERAGE_ARGS)

refit: setup ## what random scenes say of each constant of error bars (an hour in parts of 9 minutes; REFIT_ARGS="--seeds 0:120")
	$(MPI_ENV) nice $(PYTHON) -m benchmarks.refit $(REFIT_ARGS)

fuzz: setup ## random study files, damaged surfaces, datasets, stores and models; models in C with sanitizers (an hour)
	EPSMESH_FUZZ=$(FUZZ) $(MPI_ENV) $(PYTHON) -m pytest tests/fuzz -q $(PYTEST_ARGS)
	EPSMESH_FUZZ_MODELS=$(FUZZ_MODELS) $(PYTHON) -m pytest tests/realtime/test_c.py -k damaged -m "" -q -s $(PYTEST_ARGS)

pairs: setup ## run every feature of a study alone and with every other, into results/pairs.md
	$(MPI_ENV) nice $(PYTHON) -m tests.pairs

same: setup ## random scenes, each with changes that may not matter, into results/same.md (an hour; SAME_ARGS="--seeds 0:50": fewer)
	$(MPI_ENV) nice $(PYTHON) -m tests.same.campaign $(SAME_ARGS)

soak: setup ## memory and pace over 20,000 cases on 2,000 meshes (a quarter of an hour; SOAK_ARGS=2000: fewer)
	$(MPI_ENV) $(PYTHON) -m benchmarks.soak $(SOAK_ARGS)

faults: setup ## kill runs at a hundred moments, and check that no finished case is lost (an hour; FAULTS_ARGS=20 SLOW_ARGS=8: fewer)
	$(MPI_ENV) $(PYTHON) -m benchmarks.faults $(FAULTS_ARGS)
	$(MPI_ENV) $(PYTHON) -m benchmarks.faults.slow $(SLOW_ARGS)

mutants: setup ## change numbers in the code, and count those that tests notice (hours; MUTANTS_ARGS='--seed 2 --room solve')
	$(MPI_ENV) $(PYTHON) -m benchmarks.mutants $(MUTANTS_ARGS)

lint: setup ## run ruff, mypy and import-linter
	.venv/bin/ruff check
	.venv/bin/ruff format --check
	.venv/bin/mypy
	.venv/bin/lint-imports

format: setup ## fix and format with ruff
	.venv/bin/ruff check --fix
	.venv/bin/ruff format

clean: ## remove caches and the venv; results stay
	rm -rf docs/_build docs/reference .venv .pytest_cache .mypy_cache .ruff_cache .import_linter_cache *.egg-info
	find . -name __pycache__ -type d -not -path './.cache/*' -prune -exec rm -rf {} +
