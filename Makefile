# Verbs: arm, rope, car, test, check, bench, env, clean.
PYTHON ?= python3.11
ENV := .venv
RUN := $(ENV)/bin/python

arm: $(ENV)/ready ## no data to the arm's table and pictures, in build/arm
	$(RUN) -m benchmarks.arm

rope: $(ENV)/ready ## a rope that gets caught and one that does not, in build/rope
	$(RUN) -m benchmarks.rope

car: $(ENV)/ready ## no data to the car's tables and pictures, in build/car
	$(RUN) -m benchmarks.car

test: $(ENV)/ready check ## style, types and tests
	$(RUN) -m pytest

check: $(ENV)/ready
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

bench: $(ENV)/ready ## ratios behind the README's claims
	$(RUN) -m benchmarks.speed.arm

env: $(ENV)/ready

$(ENV)/ready: setup.cfg pyproject.toml constraints.txt
	$(PYTHON) -m venv $(ENV)
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable ".[test,examples,pybullet]"
	touch $@

clean:
	rm -rf $(ENV) build *.egg-info

.PHONY: arm rope car test check bench env clean
