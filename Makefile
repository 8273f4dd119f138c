# Everything needs only Python >= 3.11, make and a package index. `.venv` is made once, beside this file.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/

.PHONY: setup benchmark test fuzz lint docs weights results clean

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
	$(RUN)pytest -n 2 --dist worksteal

# A long random search for examples that break a property. `make test` tries the same few examples every time, so what
# is found here is pinned: write it above its test as `@example(...)`, with the arguments that hypothesis prints.
fuzz: setup
	$(RUN)pytest -n 2 --dist worksteal -m hypothesis --hypothesis-profile fuzz

lint: setup
	$(RUN)ruff check .
	$(RUN)ruff format --check .
	$(RUN)mypy
	$(RUN)lint-imports

# The documentation, in build/site. Quietly, mkdocs overlooks warnings.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(RUN)mkdocs build --strict
	@echo "the documentation is in build/site/index.html"

# A recogniser for exact joints from scratch, and from it, in a third of the clips, one for what an estimator sees.
FINE_TUNE := --sensor estimator --clips 6000 --learning-rate 1e-3 --init

# The weights that ship in recognition/weights and planners/weights, trained anew into models: on 2 cores about 15
# minutes a recogniser, 5 minutes a gain field and 5 minutes a seed of agents. Of the agents, seed 0 ships.
weights: setup
	set -e; for data in duo solo; do for views in moving paper; do options="--data $$data --views $$views"; \
	  train="$(RUN)ehar train recogniser $$options --out models/$$data"; \
	  $$train; $$train $(FINE_TUNE) models/$$data/causal-perfect-$$views.safetensors; \
	  for sensor in perfect estimator; do \
	    for what in gain-field agent; do \
	      $(RUN)ehar train $$what $$options --sensor $$sensor --models models/$$data; done; done; done; done

# The models and tables of docs/results.md; DATA is a folder with hdm05, bandai2 and sbu.npz. The short sequences of sbu
# are cheap, and few: more rollouts for its gain field.
DATA ?= ../shared/data
STARTS ?= 5
SEEDS ?= 5
ENCODERS := recognition vision position
PLANNERS := no-act random towards h-rotate v-rotate nbv-greedy nbv-search nbv il ppo il-ppo dagger oracle oracle-lookahead

# Train agents in models/$(1) under the conditions $(2), and compare all planners in runs/agents-$(1)-$(3).
compare = $(RUN)ehar train agent $(2) --models models/$(1) --seeds $(SEEDS) && \
  $(RUN)ehar benchmark $(PLANNERS) $(2) --models models/$(1) --starts $(STARTS) --out runs/agents-$(1)-$(3)

# Compare them as a vehicle, on the episodes of runs/agents-$(1)-estimator.
fly = $(RUN)ehar benchmark $(PLANNERS) $(2) --sensor estimator --models models/$(1) --starts $(STARTS) \
  --track tracking-drone --ideal runs/agents-$(1)-estimator --out runs/agents-$(1)-drone

# How far the policy part, which agents and gain fields were trained on, is above the test part.
own_part = $(RUN)ehar benchmark no-act nbv il ppo il-ppo dagger oracle $(2) --models models/$(1) --part policy --starts 1 \
  --no-report --out runs/policy-$(1)-$(3)

# Imitation on solo in the paper's setting with one option, $(2), otherwise as il; in models/solo-$(1).
imitate = mkdir -p models/solo-$(1) && cp models/solo/causal-perfect-paper.* models/solo-$(1) && \
  $(RUN)ehar train agent --data solo --views paper --models models/solo-$(1) --seeds $(SEEDS) --stages il $(2) && \
  $(RUN)ehar benchmark no-act il oracle --data solo --views paper --models models/solo-$(1) --starts $(STARTS) \
  --no-report --out runs/imitation-solo-$(1)

# Train recognisers and gain fields on real motion in models/$(1), with the options $(2) and $(3) batches of rollouts.
prepare = $(RUN)ehar train recogniser $(2) --out models/$(1) && \
  $(RUN)ehar train recogniser $(2) --out models/$(1) $(FINE_TUNE) models/$(1)/causal-perfect-moving.safetensors && \
  $(RUN)ehar train gain-field $(2) --models models/$(1) --batches $(3) && \
  $(RUN)ehar train gain-field $(2) --models models/$(1) --batches $(3) --sensor estimator

HDM05 := --data $(DATA)/hdm05.npz
BANDAI2 := --data $(DATA)/bandai2.npz
SBU := --data $(DATA)/sbu.npz --fps 30 --length 30

results: setup
	$(call prepare,hdm05,$(HDM05),24)
	$(call prepare,bandai2,$(BANDAI2),24)
	$(call prepare,sbu,$(SBU),40)
	$(call compare,hdm05,$(HDM05) --sensor estimator,estimator)
	$(call compare,bandai2,$(BANDAI2) --sensor estimator,estimator)
	$(call compare,sbu,$(SBU) --sensor estimator,estimator)
	for name in duo solo; do mkdir -p models/$$name && cp recognition/weights/$$name/* planners/weights/$$name/gain-field-* models/$$name; done
	$(call compare,duo,--data duo --sensor estimator,estimator)
	$(call compare,solo,--data solo --sensor estimator,estimator)
	$(call compare,duo,--data duo --views paper,paper)
	$(call compare,solo,--data solo --views paper,paper)
	$(call compare,duo,--data duo,perfect)
	$(call compare,solo,--data solo,perfect)
	$(call fly,hdm05,$(HDM05))
	$(call fly,bandai2,$(BANDAI2))
	$(call fly,sbu,$(SBU))
	$(call fly,duo,--data duo)
	$(call fly,solo,--data solo)
	for encoder in $(ENCODERS); do $(RUN)ehar train agent --data solo --views paper --models models/solo --seeds $(SEEDS) \
	  --without $$encoder --stages il,il-ppo || exit 1; done
	$(RUN)ehar benchmark no-act il il-ppo $(foreach encoder,$(ENCODERS),il-no-$(encoder) il-ppo-no-$(encoder)) oracle \
	  --data solo --views paper --models models/solo --starts $(STARTS) --out runs/encoders-solo-paper
	$(call imitate,soft,--labels soft)
	$(call imitate,lookahead,--teacher oracle-lookahead)
	$(call imitate,rounds,--rounds 2)
	# PPO from what dagger learned: il with all of dagger's options, and il-ppo from it; beside the agents as they are.
	mkdir -p models/duo-dagger && cp models/duo/causal-perfect-paper.* models/duo-dagger
	$(RUN)ehar train agent --data duo --views paper --models models/duo-dagger --seeds $(SEEDS) --stages il,il-ppo \
	  --labels soft --teacher oracle-lookahead --rounds 2
	for part in validation test; do $(RUN)ehar benchmark no-act il il-ppo oracle --data duo --views paper \
	  --models models/duo-dagger --part $$part --starts $(STARTS) --no-report --out runs/dagger-ppo-duo-$$part || exit 1; done
	$(RUN)ehar benchmark no-act il ppo il-ppo dagger oracle --data duo --views paper --models models/duo \
	  --part validation --starts $(STARTS) --no-report --out runs/validation-duo-paper
	$(call own_part,sbu,$(SBU) --sensor estimator,estimator)
	$(call own_part,solo,--data solo --views paper,paper)
	$(RUN)ehar analyse runs/agents-hdm05-estimator --planners il-ppo nbv
	$(RUN)ehar analyse runs/agents-sbu-estimator --planners il-ppo nbv --states il-ppo/0

clean:
	rm -rf $(VENV)
