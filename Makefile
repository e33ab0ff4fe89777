# Everything a newcomer needs: `make rise` runs the main job, `make test` the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: setup rise test check test-slow fuzz clean

# The main job needs the core install only; the development tools come with `setup`.
$(VENV)/core: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q -e .
	touch $@

$(VENV)/dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q -e ".[dev]"
	$(BIN)/pybind11-stubgen mujoco -o typings --ignore-all-errors > /dev/null 2>&1
	touch $(VENV)/core $@

setup: $(VENV)/dev

rise: $(VENV)/core
	$(BIN)/getup rise --robot op3 --from supine --seed 0 --out out/rise

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

test: setup
	$(BIN)/pytest -n 2 -m "not slow"

test-slow: setup
	$(BIN)/pytest -n 2 -m slow

# Ten million random and mutated bytes into each end of the wire.
fuzz: setup
	$(BIN)/python benchmarks/fuzz_protocol.py --bytes 10000000 --seed 0

clean:
	rm -rf $(VENV) typings out *.egg-info
