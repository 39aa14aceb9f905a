PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
unexport PYTHONDONTWRITEBYTECODE  # each of a hundred processes of the tests would compile the package again
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --only-binary=:all:

.PHONY: blender demo docs test fuzz lint types conformance coverage matrix dist clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(PIP) --upgrade pip
	$(PIP) hatchling editables
	$(PIP) --no-build-isolation --editable .[pictures]
	touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(PIP) --no-build-isolation --editable .[test]
	touch $@

demo: $(VENV)/.installed
	$(BIN)/signedheat demo --output demo

test: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n auto --dist worksteal

fuzz: $(VENV)/.installed-test  # CASES="1000 --seed 3" runs these
	cd tests && PYTHONPATH=.. ../$(BIN)/python -m fuzz --cases $(or $(CASES),10000)
	$(BIN)/python -m pytest -m slow

lint: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.installed-test
	$(BIN)/python tools/check_types.py

$(VENV)/.installed-docs: $(VENV)/.installed
	$(PIP) --no-build-isolation --editable .[docs]
	touch $@

docs: $(VENV)/.installed-docs  # into docs/_build/html, without a warning; runs every example of the gallery
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

conformance: $(VENV)/.installed-test  # PEERS=FOLDER with checkouts of other packages, which must be installed too
	$(BIN)/python tools/conformance $(PEERS)

coverage: $(VENV)/.installed-test
	$(BIN)/python -m coverage run -m pytest $(TESTS)
	$(BIN)/python -m coverage report

$(VENV)/.installed-matrix: $(VENV)/.installed
	$(PIP) uv
	touch $@

matrix: $(VENV)/.installed-matrix  # ROWS="3.10-lowest 3.13-highest" runs these rows alone
	$(BIN)/python .ci/matrix $(ROWS)

blender:  # the add-on, to be installed from disk in Blender 4.2 and later
	mkdir -p dist
	cd blender/signedheat_blender && $(PYTHON) -m zipfile -c ../../dist/signedheat-blender.zip blender_manifest.toml __init__.py protocol.py

dist: $(VENV)/.installed
	rm -rf dist
	$(BIN)/python -m hatchling build

clean:
	rm -rf $(VENV) .venv-matrix demo dist docs/_build docs/api docs/gallery htmlcov .coverage .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find src tests benchmarks examples -name __pycache__ -prune -exec rm -rf {} +
