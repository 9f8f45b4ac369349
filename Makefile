# Two commands are the whole set-up: `make run` and `make test`.
PYTHON ?= python3
PORT ?= 8080
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
NPM_FOLDER := tests/browser/javascript
AXE := $(NPM_FOLDER)/node_modules/axe-core/axe.min.js
SPHINX := --fail-on-warning --keep-going --nitpicky --fresh-env

.PHONY: install run axe test check docs screenshots bench fuzz accuracy torture soak format lock clean

$(STAMP): requirements/run.txt requirements/dev.txt pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "padwatch needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes -r requirements/run.txt -r requirements/dev.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

install: $(STAMP)

run: install
	@exec $(BIN)/padwatch demo --port $(PORT)

$(AXE): $(NPM_FOLDER)/package-lock.json
	npm ci --prefix $(NPM_FOLDER) --ignore-scripts --prefer-offline --no-audit --no-fund --loglevel=error
	touch $@

axe:
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory $(AXE); \
	else echo 'npm is not installed: pages are not tested with axe-core'; fi

test: install axe
	$(BIN)/python -m pytest -n 2 --dist worksteal

check: install
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/sphinx-build $(SPHINX) --quiet docs build/docs

docs: install
	$(BIN)/sphinx-build $(SPHINX) docs build/docs

bench: install
	$(BIN)/python benchmarks/ingest.py
	$(BIN)/python benchmarks/polling.py
	$(BIN)/python benchmarks/alarms.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/trend_years.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/analysis.py

fuzz: install
	$(BIN)/python benchmarks/fuzz.py

screenshots: install
	PYTHONPATH=benchmarks $(BIN)/python docs/_tools/take_pictures.py

accuracy: install
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/accuracy.py --workers 2

SEED ?= $(shell date +%s)
SOAK_MINUTES ?= 20
PLANTED = $$(grep -rl --include='test_*.py' mark.planted tests --exclude-dir torture)
torture: install
	@echo "make torture SEED=$(SEED); it takes hours"
	$(BIN)/python -m pytest tests/torture $(PLANTED) --torture --torture-seed $(SEED) --durations 20

soak: install
	$(BIN)/python -m pytest tests/torture/test_soak.py --torture --torture-seed $(SEED) --soak-minutes $(SOAK_MINUTES)

format: install
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lock: install
	for name in run dev build; do CUSTOM_COMPILE_COMMAND="make lock" $(BIN)/pip-compile --quiet --generate-hashes \
	  --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --strip-extras --allow-unsafe \
	  --output-file requirements/$$name.txt requirements/$$name.in || exit 1; done

clean:
	rm -rf $(VENV) var build dist
