# `make rise` runs the main job, `make test` the tests, `make help` lists the rest.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# On PyPI the Linux build of torch brings gigabytes of CUDA. The CPU build of the same version
# is preferred where pip can see it: docs/how-to/train.md.
TORCH ?= torch==2.13.0

# Each worker takes neighboring tests, so that what a file prepares is prepared once.
PYTEST := $(BIN)/pytest -n 2 --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help setup rise check test test-times test-train test-studio test-scale test-warp test-lerobot test-slow wheel-test docs docs-serve fuzz mutants clean

help:  ## List the targets.
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /:/' | \
		awk -F: '{ printf "  %-12s %s\n", $$1, $$2 }'

$(VENV)/core: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q -e .
	touch $@

$(VENV)/dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q -e ".[dev]"
	$(BIN)/pybind11-stubgen mujoco -o typings --ignore-all-errors > /dev/null 2>&1
	touch $(VENV)/core $@

$(VENV)/train: $(VENV)/dev
	$(BIN)/pip install -q -e ".[train]" "$(TORCH)"
	touch $@

$(VENV)/studio: $(VENV)/dev
	$(BIN)/pip install -q -e ".[studio,studio-test]"
	touch $@

$(VENV)/scale: $(VENV)/dev
	$(BIN)/pip install -q -e ".[slurm]"
	touch $@

$(VENV)/warp: $(VENV)/train
	$(BIN)/pip install -q -e ".[warp]"
	touch $@

$(VENV)/docs: $(VENV)/core
	$(BIN)/pip install -q -e ".[docs]"
	touch $@

# An environment of its own: LeRobot wants an older torch, which comes with gigabytes of CUDA. Its
# programs are run with the CPU build at hand instead, so what they import is listed here.
# 2.4 GB, about 6 minutes to install.
LEROBOT_VENV := .lerobot-venv
LEROBOT_NEEDS := "draccus==0.10.0" "datasets>=4,<5" "huggingface-hub>=0.34.2,<0.36" \
	"opencv-python-headless<4.13" "av>=15,<16" "rerun-sdk>=0.24,<0.27" "deepdiff<9" \
	"diffusers<0.36" "accelerate<2" "gymnasium<2" "termcolor<4" "packaging<26" \
	"setuptools>=77,<81" einops jsonlines imageio pynput dynamixel-sdk "pytest>=9,<10"

$(LEROBOT_VENV)/ready: pyproject.toml plugins/lerobot_robot_getup/pyproject.toml
	$(PYTHON) -m venv $(LEROBOT_VENV)
	$(LEROBOT_VENV)/bin/pip install -q "$(TORCH)" $(LEROBOT_NEEDS)
	$(LEROBOT_VENV)/bin/pip install -q --no-deps "torchvision==0.28.*" "lerobot==0.4.4"
	$(LEROBOT_VENV)/bin/pip install -q --config-settings editable_mode=compat -e .
	$(LEROBOT_VENV)/bin/pip install -q --no-deps --config-settings editable_mode=compat \
		-e plugins/lerobot_robot_getup
	touch $@

setup: $(VENV)/dev  ## Make the development environment in .venv (without torch).

rise: $(VENV)/core  ## Get an OP3 up that fell on its back; report, pictures, video in out/rise/.
	$(BIN)/getup rise --robot op3 --from supine --seed 0 --out out/rise --video out/rise/rise.webp
	@echo
	@echo "The rise: out/rise/rise.webp, as pictures out/rise/strip.png, its figures out/rise/report.json"
	@echo "Next:     $(BIN)/getup rise --from prone --seed 3 --view     another fall, in a window (needs a display)"
	@echo "          $(BIN)/getup robots                                the robots at hand"
	@echo "          docs/how-to/your_robot.md                          a body of your own"

check: setup  ## Run ruff, pyright and the import rules.
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

test: setup  ## Run the tests, but for those of learning and the slow ones.
	$(PYTEST) -m "not slow and not train and not realtime and not studio and not scale and not warp"

test-times: setup  ## Run the same tests in one process; list the largest processor times.
	$(BIN)/pytest --times 40 -m "not slow and not train and not realtime and not studio and not scale and not warp"

test-train: $(VENV)/train  ## Install the train extra with a CPU torch; run the tests of learning.
	$(PYTEST) -m "train and not slow and not warp"

test-studio: $(VENV)/studio  ## Install the studio and Chromium; run the tests of the page.
	command -v chromium > /dev/null || { apt-get -q update && apt-get -qy install chromium; } \
		> /dev/null || echo "Chromium cannot be installed: the tests of the page are skipped"
	$(BIN)/pytest -m "studio and not slow"

test-scale: $(VENV)/scale  ## Install Dask; run the tests of work on many processes.
	$(BIN)/pytest -m "scale and not slow"

test-warp: $(VENV)/warp  ## Install mujoco-warp; run its tests (kernels compile for minutes at first).
	$(BIN)/pytest -m "warp and not slow"

test-lerobot: $(LEROBOT_VENV)/ready  ## Install LeRobot; run the tests of its plugin.
	PYTHONPATH=$(CURDIR)/plugins/lerobot_robot_getup/tests/cpu_torchvision \
		$(LEROBOT_VENV)/bin/python -m pytest plugins/lerobot_robot_getup/tests

test-slow: $(VENV)/train  ## Run the slow tests, those of learning included.
	$(PYTEST) -m slow
	$(BIN)/pytest -m realtime

wheel-test: setup  ## Build the wheel; use it from a fresh environment outside the repository.
	$(BIN)/pytest -m slow tests/packaging

docs: $(VENV)/docs  ## Build the documentation into out/site; a dead link is an error.
	$(BIN)/mkdocs build --strict

docs-serve: $(VENV)/docs  ## Serve the documentation and rebuild it when a page changes.
	$(BIN)/mkdocs serve

fuzz: setup  ## Send ten million random and mutated bytes into each end of the servo bus.
	$(BIN)/python benchmarks/fuzz_protocol.py --bytes 10000000 --seed 0

mutants: $(VENV)/train  ## Put small faults into the code; count those that the tests notice (hours).
	$(BIN)/pip install -q -e ".[mutants]"
	$(BIN)/python benchmarks/mutants.py --n 40 --seed 0 --json out/mutants.json

clean:  ## Remove the environment and everything that was built.
	rm -rf $(VENV) $(LEROBOT_VENV) typings out build *.egg-info
