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

# A recogniser for exact joints from scratch, and from it, in a third of the clips, one for what an estimator sees.
FINE_TUNE := --sensor estimator --clips 6000 --learning-rate 1e-3 --init

# The weights that ship in recognition/weights and planners/weights, trained anew into models: about 15 minutes a
# recogniser and 5 minutes a gain field on 2 cores.
weights: setup
	set -e; for data in duo solo; do for views in moving paper; do options="--data $$data --views $$views"; \
	  train="$(RUN)ehar train recogniser $$options --out models/$$data"; \
	  $$train; $$train $(FINE_TUNE) models/$$data/causal-perfect-$$views.safetensors; \
	  for sensor in perfect estimator; do \
	    $(RUN)ehar train gain-field $$options --sensor $$sensor --models models/$$data; done; done; done

# The models and tables of docs/results.md on real motion; DATA is a folder with hdm05, bandai2 and sbu.npz. The short
# sequences of sbu are cheap, and few: more rollouts.
DATA ?= ../shared/data
STARTS ?= 5
PLANNERS := no-act random towards h-rotate v-rotate nbv-greedy nbv-search nbv oracle
results: setup
	set -e; for set in hdm05 bandai2 'sbu --fps 30 --length 30'; do name=$${set%% *}; \
	  options="--data $(DATA)/$$name.npz $${set#$$name}"; train="$(RUN)ehar train recogniser --out models/$$name $$options"; \
	  $$train; $$train $(FINE_TUNE) models/$$name/causal-perfect-moving.safetensors; \
	  batches=$$([ $$name = sbu ] && echo 40 || echo 24); \
	  for sensor in perfect estimator; do \
	    $(RUN)ehar train gain-field $$options --models models/$$name --sensor $$sensor --batches $$batches; \
	    $(RUN)ehar benchmark $(PLANNERS) $$options --sensor $$sensor --models models/$$name --starts $(STARTS) \
	      --out runs/nbv-$$name-$$sensor; done; done
	set -e; for name in duo solo; do for sensor in perfect estimator; do \
	  $(RUN)ehar benchmark $(PLANNERS) --data $$name --sensor $$sensor --starts $(STARTS) --out runs/nbv-$$name-$$sensor; done; done

clean:
	rm -rf $(VENV)
