# Everything needs only Python >= 3.11, make and a package index. `.venv` is made once, beside this file.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/

.PHONY: setup benchmark test lint weights results clean

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

# The weights that ship in recognition/weights, trained anew into models: about 15 minutes each on 2 cores.
weights: setup
	for data in duo solo; do for sensor in perfect estimator; do for views in moving paper; do \
	  $(RUN)ehar train recogniser --data $$data --out models/$$data --sensor $$sensor --views $$views \
	  || exit; done; done; done

# The tables of docs/results.md on real motion; DATA is a folder with hdm05.npz, bandai2.npz and sbu.npz.
DATA ?= ../shared/data
results: setup
	for set in 'hdm05' 'bandai2' 'sbu --fps 30 --length 30'; do for sensor in perfect estimator; do \
	  name=$${set%% *}; options="--data $(DATA)/$$name.npz --sensor $$sensor $${set#$$name}"; \
	  $(RUN)ehar train recogniser $$options --out models/$$name && \
	  $(RUN)ehar benchmark $$options --models models/$$name --starts 3 --out runs/$$name-$$sensor-moving \
	  || exit; done; done

clean:
	rm -rf $(VENV)
