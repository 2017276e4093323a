# Each target makes its own virtual environment; nothing else is needed but Python 3.11 or later.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: test lint demo clean
.DELETE_ON_ERROR:

$(VENV)/ready: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable ".[test,lint]"
	touch $@

test: $(VENV)/ready
	$(BIN)/python -m pytest -n 2 --dist loadfile

lint: $(VENV)/ready
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# The main job on built-in data: four detectors on simulated approaches, a table, a picture, a run folder to look into.
demo: $(VENV)/ready
	rm -rf demo
	$(BIN)/uwbbench run configs/experiments/demo.yaml --out demo
	$(BIN)/uwbbench plot cdf demo -o demo/errors.png

clean:
	rm -rf $(VENV) demo build dist
