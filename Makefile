# Everything needs only Python >= 3.11, make and a package index. `.venv` is made once, beside this file.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/

.PHONY: setup benchmark test lint clean

setup: $(VENV)/.installed

# torch first and by itself: its exact version decides which build the index hands out.
$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "ehar needs Python 3.11 or newer, this is " + sys.version)'
	$(PYTHON) -m venv $(VENV)
	$(RUN)python -m pip install --quiet --upgrade pip
	$(RUN)python -m pip install --quiet --constraint constraints.txt torch==2.13.0
	$(RUN)python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $@

benchmark: setup
	$(RUN)ehar benchmark --data duo --out runs/duo-perfect-moving

test: setup
	$(RUN)pytest -n 2

lint: setup
	$(RUN)ruff check .
	$(RUN)ruff format --check .
	$(RUN)mypy
	$(RUN)lint-imports

clean:
	rm -rf $(VENV)
