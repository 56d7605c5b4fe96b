# Verbs: arm, rope, car, test, check, bench, docs, env, clean; test-lowest, test-newest, test-sdist, test-matrix.
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
	$(RUN) -m pytest -n 2 --dist worksteal

LOWEST := .venv-lowest
test-lowest: ## with the lowest versions that setup.cfg allows, in an environment of their own
	$(PYTHON) -m venv $(LOWEST)
	$(PYTHON) tests/lowest_versions.py > $(LOWEST)/constraints.txt
	$(LOWEST)/bin/python -m pip install --quiet --constraint $(LOWEST)/constraints.txt --editable ".[all,test]"
	$(LOWEST)/bin/python -m pytest $(TESTS)

# With the newest dependencies, in an environment for each Python; EXTRAS=test leaves out torch.
EXTRAS ?= all,test
NEWEST := .venv-newest/$(notdir $(PYTHON))
test-newest: ## such as make test-newest PYTHON=python3.13 EXTRAS=test
	$(PYTHON) -m venv $(NEWEST)
	$(NEWEST)/bin/python -m pip install --quiet --upgrade --editable ".[$(EXTRAS)]"
	$(NEWEST)/bin/python -m pytest $(TESTS)

# What is not in the source distribution is missed; TESTS=tests/test_packages.py runs a part.
SDIST := build/sdist
test-sdist: $(ENV)/ready ## from a source distribution, unpacked in an empty folder
	$(RUN) -m pip install --quiet "build>=1.2"
	rm -rf $(SDIST) && $(RUN) -m build --sdist --outdir $(SDIST) . > /dev/null
	mkdir $(SDIST)/unpacked && tar -xzf $(SDIST)/*.tar.gz -C $(SDIST)/unpacked --strip-components 1
	cd $(SDIST)/unpacked && PYTHONPATH=. $(abspath $(RUN)) -m pytest $(TESTS)

# What CI runs, with each of these Pythons that is here.
PYTHONS := $(shell for version in 3.11 3.12 3.13; do python$$version -c "" 2> /dev/null && echo python$$version; done)
test-matrix: test test-lowest test-sdist ## every leg of .github/workflows/tests.yml
	for python in $(PYTHONS); do $(MAKE) test-newest PYTHON=$$python || exit 1; done
	$(MAKE) test-newest PYTHON=$(lastword $(PYTHONS)) NEWEST=.venv-newest/without-extras EXTRAS=test

check: $(ENV)/ready
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

# GALLERY=none runs no examples, GALLERY=car only those whose names hold "car".
docs: $(ENV)/ready-for-docs ## these pages, in build/docs/html
	GALLERY="$(GALLERY)" $(RUN) -m sphinx -b html --fail-on-warning --keep-going \
		-d build/docs/doctrees docs build/docs/html

bench: $(ENV)/ready ## ratios of speed, as in docs/performance.md
	$(RUN) -m benchmarks.speed.arm

env: $(ENV)/ready

$(ENV)/ready: setup.cfg pyproject.toml constraints.txt
	$(PYTHON) -m venv $(ENV)
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable ".[all,test]"
	touch $@

$(ENV)/ready-for-docs: $(ENV)/ready
	$(RUN) -m pip install --quiet --constraint constraints.txt --editable ".[docs]"
	touch $@

clean:
	rm -rf $(ENV) .venv-newest $(LOWEST) build docs/api docs/gallery *.egg-info

.PHONY: arm rope car test test-lowest test-newest test-sdist test-matrix check docs bench env clean
