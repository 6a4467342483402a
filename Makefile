# make demo: set up and run the demo.  make test: set up and run the tests.
# make docs: build the site of the documentation into site/.
# TORCH_INDEX names another wheel index for torch, such as PyTorch's own for CPU builds.
# EXTRAS adds optional dependencies: make setup EXTRAS=test,rerun

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
EXTRAS ?= test
LIBS := libusb-1.0-0 libgl1 libegl1 libgomp1

.PHONY: demo test check docs setup clean system-libraries

demo: setup
	$(BIN)/semslam demo --out demo-run

test: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: setup $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

setup: system-libraries $(VENV)/.ready

$(VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "semslam needs Python 3.11 or newer.")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt $(if $(TORCH_INDEX),--index-url $(TORCH_INDEX)) torch
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[$(EXTRAS)]'
	touch $@

$(VENV)/.docs: $(VENV)/.ready
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

# Open3D's wheel loads these shared libraries; they are installed where the user may, and named where not.
system-libraries:
	@sh scripts/system-libraries.sh $(LIBS)

clean:
	rm -rf $(VENV) demo-run build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
