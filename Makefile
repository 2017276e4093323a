# Each target makes its own virtual environment; nothing else is needed but Python 3.11 or later.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: test test-slow fuzz lint bench demo docs pictures leaderboard leaderboard-check clean
.DELETE_ON_ERROR:

$(VENV)/ready: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable ".[test,lint,docs]"
	touch $@

# Tests start many processes, which need not compile what they import each time anew: bytecode is kept.
test test-slow: export PYTHONDONTWRITEBYTECODE =
# Two workers share the cores already: threads over small matrices only wait for each other.
test test-slow: export OPENBLAS_NUM_THREADS = 1

# The files in their order, not those of the most tests first: those of few tests are often the longest.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

test: $(VENV)/ready
	$(PYTEST) -m "not slow and not browser"

# What takes longer: pages in a real browser, examples of the documentation, packages installed by pip.
test-slow: $(VENV)/ready
	$(PYTEST) -m "slow or browser"

# Damaged copies of every format that is read, so many of each: an hour and a half or so. New ones each time; what it
# prints first repeats them.
FLIPS ?= 20000
fuzz: $(VENV)/ready
	$(BIN)/python -m tests.fuzz.run $(FLIPS)

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

# Pages to read offline: build/docs/index.html. Every warning is an error; tests/docs runs the examples.
docs: $(VENV)/ready
	$(BIN)/sphinx-build --fail-on-warning --quiet --jobs auto docs build/docs

# All shipped detectors on the suite: its site in build/leaderboard/site, and what the README and the documentation say
# of it. A quarter of an hour on two cores, nine minutes of it the run. The check runs the quick version, one minute, and
# fails where what is written is not what the suite and the detectors give now.
leaderboard: $(VENV)/ready
	$(BIN)/python docs/leaderboard/publish.py build/leaderboard

leaderboard-check: $(VENV)/ready
	$(BIN)/python docs/leaderboard/publish.py build/leaderboard --check

# The pictures in docs/images, from simulated captures; takes some minutes.
pictures: $(VENV)/ready
	$(BIN)/python docs/pictures/draw.py build/pictures

clean:
	rm -rf $(VENV) demo build dist
