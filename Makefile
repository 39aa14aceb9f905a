PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
unexport PYTHONDONTWRITEBYTECODE  # each of a hundred processes of the tests would compile the package again
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --only-binary=:all:

.PHONY: help blender demo docs paper test fuzz lint types conformance coverage matrix dist wheel clean

help:  # what there is to make
	@sed -nE 's/^([a-z]+):[^#]*(# )?(.*)/  \1  \3/p' $(MAKEFILE_LIST) | awk '{name = $$1; $$1 = ""; printf "  make %-12s%s\n", name, $$0}'

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP) --upgrade pip
	$(PIP) hatchling editables
	$(PIP) --no-build-isolation --editable .[pictures]
	touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(PIP) --no-build-isolation --editable .[test]
	touch $@

demo: $(VENV)/.installed  # the main job on a shape that comes along: files and a picture in demo/
	$(BIN)/signedheat demo --output demo

test: $(VENV)/.installed-test  # the whole suite
	$(BIN)/python -m pytest -n auto --dist worksteal

fuzz: $(VENV)/.installed-test  # 10,000 cases of every family of bad input; CASES="1000 --seed 3" runs these
	cd tests && PYTHONPATH=.. ../$(BIN)/python -m fuzz --cases $(or $(CASES),10000)
	$(BIN)/python -m pytest -m slow

lint: $(VENV)/.installed-test  # ruff: rules and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-test  # mypy, on the code of the first pages too
	$(BIN)/python tools/check_types.py

$(VENV)/.installed-docs: $(VENV)/.installed
	$(PIP) --no-build-isolation --editable .[docs]
	touch $@

paper: $(VENV)/.installed-test  # docs/paper.md and its pictures, measured anew; FIGURES="8 10" for some of it
	$(BIN)/python benchmarks/paper.py $(FIGURES)

docs: $(VENV)/.installed-docs  # into docs/_build/html, without a warning; runs every example of the gallery
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

$(VENV)/.installed-conformance: $(VENV)/.installed-test
	$(PIP) --no-build-isolation --editable .[conformance]
	touch $@

conformance: $(VENV)/.installed-conformance  # tests of other packages with our functions; PEERS=FOLDER with their checkouts
	$(BIN)/python tools/conformance $(PEERS)

coverage: $(VENV)/.installed-test  # the suite with coverage; TESTS=tests/io for some of it
	$(BIN)/python -m coverage run -m pytest $(TESTS)
	$(BIN)/python -m coverage report

$(VENV)/.installed-matrix: $(VENV)/.installed
	$(PIP) uv
	touch $@

matrix: $(VENV)/.installed-matrix  # lowest and highest versions, and more; ROWS="3.10-lowest first-pages" for some of it
	$(BIN)/python .ci/matrix $(ROWS)

blender:  # the add-on, to be installed from disk in Blender 4.2 and later
	mkdir -p dist
	cd blender/signedheat_blender && $(PYTHON) -m zipfile -c ../../dist/signedheat-blender.zip blender_manifest.toml __init__.py protocol.py

dist: $(VENV)/.installed  # a wheel and a source archive in dist/
	rm -rf dist
	$(BIN)/python -m hatchling build

wheel: $(VENV)/.installed  # a wheel in dist/ for this Python and Numba, with everything compiled
	SIGNEDHEAT_KERNELS=1 $(BIN)/python -m hatchling build -t wheel

clean:  # remove everything that these make
	rm -rf $(VENV) .venv-matrix demo dist docs/_build docs/api docs/gallery htmlcov .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find src tests benchmarks examples -name __pycache__ -prune -exec rm -rf {} +
