# Two commands on a fresh machine: `make demo` and `make test`. Each sets up its own .venv.
# `make test` is what one runs while working; `make test-all` is everything, and what .ci/run calls.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-all check lint bench audit clean
demo: $(VENV)/.ready
	$(BIN)/tandem demo $(ARGS)

PARALLEL := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal
test: $(VENV)/.ready
	$(PARALLEL) -m "not long and not live and not bench" $(ARGS)

# the live tests run one after the other: two at a time would take each other's cores
test-all: $(VENV)/.ready
	.ci/tests $(ARGS)

bench: $(VENV)/.ready
	$(BIN)/tandem bench $(ARGS)

# the bill of materials, and the known vulnerabilities where the network reaches their database
audit: $(VENV)/.ready
	$(BIN)/tandem audit $(ARGS)

check: lint
	$(BIN)/mypy

lint: $(VENV)/.ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

$(VENV)/.ready: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[dev]"
	touch $@

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
