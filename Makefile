# Each target makes its own virtual environment; nothing else is needed but Python 3.11 or later.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: test lint bench demo clean
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

# Every speed target against what is measured here: about half an hour on a machine that does nothing else, most of it
# for the gates. A C compiler builds the floor that the detectors are held against. BENCH=--quick only shows that
# everything runs and agrees.
BENCH ?= --paced 60 --gates 100
bench: $(VENV)/ready
	$(BIN)/python tests/bench/run.py $(BENCH)

# The main job on built-in data: four detectors on simulated approaches, a table, a picture, a run folder to look into.
demo: $(VENV)/ready
	rm -rf demo
	$(BIN)/uwbbench run configs/experiments/demo.yaml --out demo
	$(BIN)/uwbbench plot cdf demo -o demo/errors.png

clean:
	rm -rf $(VENV) demo build dist
