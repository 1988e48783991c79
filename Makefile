# Each target makes the .venv that it needs by itself; Python >= 3.11 and pip are all it takes.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
MISSION ?= missions/follow_line.yaml
FLY ?= --speed 1.5
PYTEST ?=

.PHONY: fly test test-v4l2 test-page fuzz golden check bench bench-inspection bench-vision bench-jitter bench-soak bench-following bench-rendered world-pictures schema diagram safety-table streams-table clean clean-v4l2

fly: $(VENV)/.installed
	$(BIN)/lineflight dry-run $(MISSION) $(FLY)

test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -n auto -m "not real_time"
	$(BIN)/python -m pytest -n 2 -m real_time --ignore tests/e2e --ignore tests/vision_worker
	$(BIN)/python -m pytest -m real_time tests/e2e tests/vision_worker

test-v4l2: $(VENV)/.installed-dev
	$(BIN)/python -m tests.v4l2_guest.boot $(PYTEST)

test-page: $(VENV)/.installed-dev
	$(BIN)/python -m tests.page_browser $(PYTEST)

fuzz: $(VENV)/.installed-dev
	LINEFLIGHT_EXAMPLES=fuzz $(BIN)/python -m pytest -n auto -m "hypothesis and not real_time" $(PYTEST)

golden: $(VENV)/.installed-dev
	$(BIN)/python -m tests.replay.golden

check: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.flights

bench-vision: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.vision $(if $(DATA),--data $(DATA))

bench-rendered: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.rendered_lines $(if $(DATA),--data $(DATA))

world-pictures: $(VENV)/.installed
	$(BIN)/python -m benchmarks.world_gallery

bench-jitter: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.jitter

bench-soak: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.soak

bench-inspection: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.inspection

bench-following: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.following

schema: $(VENV)/.installed
	$(BIN)/python -c "from mission.plan_file import schema_text; print(schema_text(), end='')" > missions/mission.schema.json
	$(BIN)/python -c "from sitl.world.file import schema_text; print(schema_text(), end='')" > sitl/worlds/world.schema.json

safety-table: $(VENV)/.installed-dev
	$(BIN)/python -m tests.faults.page

streams-table: $(VENV)/.installed-dev
	$(BIN)/python -m tests.docs.streams_table

diagram: $(VENV)/.installed
	$(BIN)/python -m tests.docs.state_machine_page

clean:
	rm -rf $(VENV) .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -prune -exec rm -rf {} +

clean-v4l2:
	rm -rf .v4l2-guest

$(VENV)/bin/python:
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'lineflight needs Python 3.11 or newer; try make PYTHON=python3.12')"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --group dev
	touch $@
