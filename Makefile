# make sweep   set up, then predict and measure the zoom, focus and selection sweeps
# make quick   set up, lint, type-check, and run the tests that render nothing and take a moment: under two minutes
# make test    set up, lint, type-check pss/, and run the tests, the correlation gate among them
# make acceptance   what must be shown but takes longer than `make test` may
# make docs    the documentation as a site, docs/_build/html/index.html
# make first-screen   draw the README's first picture anew, from the zoom sweep's stored views
# make screenshots    take the pictures of docs/report.md from the report of `make sweep`; needs a chromium
# make notebook    run docs/notebook.ipynb again and keep its outputs
# make lock    write requirements.lock anew from pyproject.toml

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
UV_VERSION := 0.13.9

# One view a core: numerical libraries that start threads of their own only get in each other's way.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: sweep quick test lint tests acceptance docs first-screen screenshots notebook lock clean

sweep: $(VENV)/installed
	$(BIN)/python validate/run_sweep.py zoom focus selection $(ARGS)

quick: lint
	$(BIN)/python -m pytest -m "not render and not slow and not acceptance" -q -n 2 --dist loadfile

test: lint tests

lint: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/mypy

# In two processes, since few tests keep two cores busy; a file stays in one, as its tests share what they rendered.
tests: $(VENV)/installed
	$(BIN)/python -m pytest -m "not acceptance" -q -n 2 --dist loadfile

acceptance: $(VENV)/installed
	$(BIN)/python -m pytest -m acceptance -s

docs: $(VENV)/installed
	$(BIN)/python -m sphinx -q -W --keep-going -n -d docs/_build/doctrees docs docs/_build/html

first-screen: $(VENV)/installed
	PYTHONPATH=. $(BIN)/python docs/draw_first_screen.py

screenshots: $(VENV)/installed
	$(BIN)/python validate/run_sweep.py selection --set sensor.exposure_ms=1 --out results/short-exposure --quiet
	$(BIN)/python validate/run_sweep.py compare results/zoom-focus-selection results/short-exposure
	PYTHONPATH=. $(BIN)/python docs/take_screenshots.py

notebook: $(VENV)/installed
	PYTHONPATH=. $(BIN)/python docs/run_notebook.py

$(VENV)/installed: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "python3 is older than 3.11; allowed is 3.11 or newer (make PYTHON=python3.12 ...)" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

lock:
	$(PYTHON) -m venv $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet uv==$(UV_VERSION)
	$(VENV)-lock/bin/uv pip compile --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
	  --extra dev --custom-compile-command "make lock" pyproject.toml -o requirements.lock
	rm -r $(VENV)-lock

clean:
	rm -rf $(VENV) docs/_build .pytest_cache .mypy_cache .ruff_cache .hypothesis
