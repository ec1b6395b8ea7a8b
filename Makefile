# Everything a person or CI does with this repository starts here; `make help` lists it.
# The recipes only say what runs: how a step is done stands in tools/ and in the Python packages.

MAKEFLAGS += --no-builtin-rules --warn-undefined-variables
.DEFAULT_GOAL := all
.DELETE_ON_ERROR:
.SUFFIXES:

# Another interpreter for .venv: make PYTHON=python3.12 (default: the first one >= 3.11 in PATH).
PYTHON ?=
# One specification, such as controllers/puma3.toml (default: codegen writes all of them).
CONTROLLER ?=
# The experiment that `make simulate` runs.
EXPERIMENT ?= Exp08
# The robot that `make tune` and `make autotune` tune on, and `make tuning-check` flies.
PLANT ?= reference_flexible
# How long `make fuzz` takes in all, besides compiling; it goes on until every controller has taken
# STEPS steps, such as 1e8.
MINUTES ?= 5
STEPS ?= 0
# More words for pytest: make test PYTEST_ARGS="-k sig_pow -x".
PYTEST_ARGS ?=
# `make lock UPGRADE=1` moves the pinned versions forward; without it they stay where they can.
UPGRADE ?=

export PYTHON UPGRADE
# A sourced ROS workspace puts its own numpy and pinocchio before ours; the packages in
# ~/.local would do the same. Only what constraints.txt pins may answer an import.
unexport PYTHONPATH PYTHONHOME
export PYTHONNOUSERSITE := 1

run := .venv/bin/python

## Set up, generate the C, run the closed loops and write the report: the whole thing
.PHONY: all
all:
# One after the other, also under -j: the report tests the C that codegen has just written.
	@$(MAKE) --no-print-directory codegen
	@$(MAKE) --no-print-directory report
	@tools/next_steps.sh

## Install what is missing: system packages (apt) and the Python environment .venv
.PHONY: setup
setup:
	@tools/system_tools.sh build
	@tools/make_venv.sh

## Write generated/NAME/ from controllers/NAME.toml; one with CONTROLLER=controllers/NAME.toml
.PHONY: codegen
codegen: setup
	@$(run) -m codegen generate $(CONTROLLER)
	@$(run) -m verification tuning-check --summary $(CONTROLLER)

## Regenerate twice into temporary folders and compare every byte with generated/
.PHONY: check-generated
check-generated: setup
	@$(run) -m codegen check

## Run the experiments and checks and write build/report/index.html
.PHONY: report
report: setup
	@$(run) -m verification report

## Run one closed loop: make simulate CONTROLLER=controllers/puma3.toml EXPERIMENT=Exp08
.PHONY: simulate
simulate: setup
	@$(run) -m plant simulate $(or $(CONTROLLER),controllers/puma3.toml) --experiment $(EXPERIMENT)

## The paper's tuning procedure on a plant: make tune CONTROLLER=controllers/puma3.toml PLANT=NAME
.PHONY: tune
tune: setup
	@$(run) -m plant tune $(or $(CONTROLLER),controllers/puma3.toml) --robot $(PLANT)

## Gains by an optimiser over random plants, compared with `make tune` on others: PLANT=NAME
.PHONY: autotune
autotune: setup
	@$(run) -m plant autotune $(or $(CONTROLLER),controllers/puma3.toml) --robot $(PLANT)

## Are a gain set's gains safe, and how good are they: make tuning-check CONTROLLER=... PLANT=NAME
.PHONY: tuning-check
tuning-check: setup
	@$(run) -m verification tuning-check $(or $(CONTROLLER),controllers/puma3.toml) --plant $(PLANT)

## Build the firmware stub: every controller for every board, into build/firmware/
.PHONY: firmware
firmware: setup
	@tools/system_tools.sh test firmware
	@$(MAKE) --no-print-directory -C firmware_stub every

## Package a controller's C for CMake, FMI, PlatformIO, ESP-IDF, Zephyr, Arduino; try each
.PHONY: package
package: setup
	@tools/system_tools.sh test firmware package
	@$(run) -m package $(CONTROLLER)

## Measure flash, RAM and stack of the firmware per controller and board
.PHONY: size
size: setup
	@tools/system_tools.sh test firmware
	@$(run) -m verification.size

## Processor in the loop: 12 000 ticks with the controller on each emulated board, bit for bit
.PHONY: pil
pil: setup
	@tools/system_tools.sh test firmware
	@$(run) -m verification.pil

## Every row of the paper's Table II on four plants, beside the paper's errors
.PHONY: table2
table2: setup
	@$(run) -m verification table2

## Table II flown in float32, float64 and fixed-point: what the accuracy of the powers is worth
.PHONY: accuracy
accuracy: setup
	@$(run) -m verification accuracy

## Table II on over 1000 random plants, and where its gains are safe: half an hour
.PHONY: claim
claim: setup
# What is interrupted goes on where it was; what is flown already is not flown again.
	@for name in claim_rigid claim_flexible safe_map; do \
	    $(run) -m plant campaign plant/campaigns/$$name.toml >/dev/null || exit; done
	@$(run) -m verification claim

## The paper's figures from our own data: SVG, PDF, and a page with zoom in build/verification/figures/
.PHONY: figures
figures: setup
	@$(run) -m verification figures

## A page to play with: the shipped C as WebAssembly, sliders for its gains, no network
.PHONY: playground
playground: setup
	@$(run) -m verification playground

## Hsia, Jin, sliding modes, MFC: each written by itself, has it the bits of the inclusive C?
.PHONY: special-cases
special-cases: setup
	@$(run) -m verification special-cases

## PID, computed torque, sliding mode, Hsia beside the inclusive law: tuned alike, then flown
.PHONY: rivals
rivals: setup
	@$(run) -m verification rivals

## Faults of encoders, timing, drives and reference in motion, with the C's guards and without
.PHONY: faults
faults: setup
	@$(run) -m verification faults

## The law exact, in double, in C on the host and on each emulated board, a million steps on each
.PHONY: chain
chain: setup
	@tools/system_tools.sh test firmware
	@$(run) -m verification chain

## The generated C under libFuzzer, ASan and UBSan: make fuzz MINUTES=60, or STEPS=1e8
.PHONY: fuzz
fuzz: setup
	@tools/system_tools.sh fuzz
	@$(run) -m verification fuzz --minutes $(MINUTES) --steps $(STEPS)

## Directed tests of the generated C: every branch (gcovr), every condition (MC/DC, clang)
.PHONY: coverage
coverage: setup
	@tools/system_tools.sh fuzz
	@$(run) -m verification coverage

## Count a step's instructions, flash and stack on each processor; measure the plants' pace
.PHONY: bench
bench: setup
	@tools/system_tools.sh test firmware
	@$(run) -m verification.bench
	@$(run) -m plant bench

## Run the tests; narrow them with PYTEST_ARGS="-k WORD"
.PHONY: test
test: setup
	@tools/system_tools.sh test firmware fuzz package
# Tests of one file share what takes long to make, and go on where the one before ended.
	@$(run) -m pytest --numprocesses auto --dist loadfile $(PYTEST_ARGS)

## Check style, types and C rules: ruff, mypy, clang-format, clang-tidy, cppcheck (MISRA), gcc
.PHONY: lint
lint: setup
	@tools/system_tools.sh lint
	@$(run) tools/lint.py

## Write constraints.txt anew from pyproject.toml; newer versions with UPGRADE=1
.PHONY: lock
lock:
	@tools/lock.sh

## Delete what the targets wrote: build/ and the tools' caches
.PHONY: clean
clean:
	@rm -rf build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	@find . -path ./.venv -prune -o -path ./.git -prune -o \
	    -type d -name __pycache__ -prune -exec rm -rf {} +

## clean, and the Python environment .venv too (making it again takes one to two minutes)
.PHONY: distclean
distclean: clean
	@rm -rf .venv *.egg-info

## List the targets
.PHONY: help
help:
	@tools/help.sh $(firstword $(MAKEFILE_LIST))
