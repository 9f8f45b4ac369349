# Two commands are the whole set-up: `make run` and `make test`.
PYTHON ?= python3
PORT ?= 8080
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEV_STAMP := $(VENV)/.developing
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --require-hashes
NPM_FOLDER := tests/browser/javascript
AXE := $(NPM_FOLDER)/node_modules/axe-core/axe.min.js
SPHINX := --fail-on-warning --keep-going --nitpicky --fresh-env

WORKERS ?= 8
PYTEST := $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

.PHONY: install develop run axe test test-long mutants check lint types contracts docs screenshots drawings bench fuzz accuracy torture soak \
  format lock clean

$(STAMP): requirements/run.txt requirements/build.txt pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "padwatch needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	$(PIP) -r requirements/run.txt -r requirements/build.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	$(BIN)/python -m compileall -q -j 0 core acquisition service
	touch $@

$(DEV_STAMP): $(STAMP) requirements/dev.txt
	$(PIP) -r requirements/run.txt -r requirements/dev.txt
	-$(BIN)/python -m pytest --collect-only -qq >/dev/null  # compiles the tests once; each worker would
	touch $@

install: $(STAMP)

develop: $(DEV_STAMP)

run: install
	@exec $(BIN)/padwatch demo --port $(PORT)

$(AXE): $(NPM_FOLDER)/package-lock.json
	npm ci --prefix $(NPM_FOLDER) --ignore-scripts --prefer-offline --no-audit --no-fund --loglevel=error
	touch $@

axe:
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory $(AXE); \
	else echo 'npm is not installed: pages are not tested with axe-core'; fi

test: develop axe
	$(PYTEST)

test-long: develop axe
	$(PYTEST) -m long $(LEAVE_OUT)

mutants: develop
	$(BIN)/python tests/mutants/run.py

check: lint types contracts docs

lint: develop
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	! grep -rnwiE --include='*.py' -f .ci/banned-phrases core acquisition service

types: develop
	$(BIN)/mypy

contracts: develop
	$(BIN)/lint-imports

docs: develop
	$(BIN)/sphinx-build $(SPHINX) --quiet docs build/docs

bench: develop
	$(BIN)/python benchmarks/ingest.py
	PYTHONPATH=tests/torture:tests/contract $(BIN)/python benchmarks/polling.py --postgres
	$(BIN)/python benchmarks/storms.py
	$(BIN)/python benchmarks/alarms.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/trend_years.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/analysis.py

fuzz: develop
	$(BIN)/python benchmarks/fuzz.py

screenshots: develop
	PYTHONPATH=benchmarks $(BIN)/python docs/_tools/take_pictures.py

drawings: develop
	$(BIN)/python docs/_tools/drawings.py

accuracy: develop
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/accuracy.py --workers 2

SEED ?= $(shell date +%s)
SOAK_MINUTES ?= 20
PLANTED = $$(grep -rl --include='test_*.py' mark.planted tests --exclude-dir torture)
torture: develop
	@echo "make torture SEED=$(SEED); it takes hours"
	$(BIN)/python -m pytest tests/torture $(PLANTED) -m "" --torture --torture-seed $(SEED) --durations 20

soak: develop
	$(BIN)/python -m pytest tests/torture/test_soak.py -m "" --torture --torture-seed $(SEED) --soak-minutes $(SOAK_MINUTES)

format: develop
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lock: develop
	for name in run dev build; do CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/pip-compile --quiet --generate-hashes \
	  --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --strip-extras --allow-unsafe \
	  --output-file requirements/$$name.txt requirements/$$name.in || exit 1; done

clean:
	rm -rf $(VENV) var build dist
