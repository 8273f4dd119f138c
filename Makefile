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

# The models, the runs, and the tables of docs/results; DATA is a folder with hdm05, bandai2 and sbu.npz. The short
# sequences of sbu are cheap, and few: more rollouts for its gain field.
DATA ?= ../shared/data
STARTS ?= 5
SEEDS ?= 5
ENCODERS := recognition vision position
RULES := no-act random towards h-rotate v-rotate nbv-greedy nbv-search nbv
PLANNERS := $(RULES) il ppo il-ppo dagger oracle oracle-lookahead
SETS := duo solo hdm05 bandai2 sbu
VEHICLES := px4-auto px4-max tracking-drone

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

# Compare the planners that are not agents through the sensor $(3), in runs/nbv-$(1)-$(3), on data and models $(2).
without_agents = $(RUN)ehar benchmark $(RULES) oracle $(2) --sensor $(3) --starts $(STARTS) --out runs/nbv-$(1)-$(3)

# The belief on $(1), whose data and models are $(2), with both sensors.
believe = for sensor in perfect estimator; do \
  $(RUN)ehar study belief $(2) --sensor $$sensor --out runs/belief-$(1)-$$sensor || exit 1; done

# What fixed cameras win on $(1), whose data and models are $(2).
fixed = $(RUN)ehar study headroom $(2) --sensor estimator --azimuths 6 --polars 3 --out runs/headroom-$(1)-estimator

# Write the page docs/results/$(1).md with the title $(2): the command $(3), when it ran, and the tables $(4).
page = { printf '%s\n' '\# $(2)' '' '```' '$(3)' '```' '' \
  "Measured on $$(date +%F), at commit $$(git rev-parse --short HEAD). \`make results\` runs all of it again and writes this" \
  'page. [What these figures are](../results.md\#what-these-figures-are) says how to read them.' ''; \
  for table in $(4); do cat $$table; echo; done; } > docs/results/$(1).md

# Put runs $(3) side by side, with the differences of the planner $(4), on the page $(1) with the title $(2).
side_by_side = $(RUN)ehar study overview $(3) --planner $(4) --out runs/$(1).md && \
  $(call page,$(1),$(2),ehar study overview $(3) --planner $(4),runs/$(1).md)

HDM05 := --data $(DATA)/hdm05.npz
BANDAI2 := --data $(DATA)/bandai2.npz
SBU := --data $(DATA)/sbu.npz --fps 30 --length 30

LONG := --data solo --sensor estimator --length 150 --starts 2
CONDITIONS := $(foreach name,duo solo,$(foreach kind,paper perfect estimator,runs/agents-$(name)-$(kind)))

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
	$(RUN)ehar study analyse runs/agents-hdm05-estimator --planners il-ppo nbv
	$(RUN)ehar study analyse runs/agents-sbu-estimator --planners il-ppo nbv --states il-ppo/0
	$(call without_agents,duo,--data duo,perfect)
	$(call without_agents,solo,--data solo,perfect)
	$(call without_agents,hdm05,$(HDM05) --models models/hdm05,perfect)
	$(call without_agents,bandai2,$(BANDAI2) --models models/bandai2,perfect)
	$(call without_agents,sbu,$(SBU) --models models/sbu,perfect)
	$(RUN)ehar benchmark $(RULES) oracle $(LONG) --out runs/flight-solo-ideal
	for track in $(VEHICLES); do $(RUN)ehar benchmark $(RULES) oracle $(LONG) --track $$track --ideal runs/flight-solo-ideal \
	  --out runs/flight-solo-$$track || exit 1; done
	$(RUN)ehar study ablation $(SBU) --models models/sbu --sensor estimator --starts $(STARTS) --tracks $(VEHICLES) \
	  --out runs/ablation-sbu-estimator
	$(call believe,duo,--data duo)
	$(call believe,solo,--data solo)
	$(call believe,hdm05,$(HDM05) --models models/hdm05)
	$(call believe,bandai2,$(BANDAI2) --models models/bandai2)
	$(call believe,sbu,$(SBU) --models models/sbu)
	$(call fixed,hdm05,$(HDM05) --models models/hdm05)
	$(call fixed,bandai2,$(BANDAI2) --models models/bandai2)
	$(call fixed,sbu,$(SBU) --models models/sbu)
	$(RUN)ehar study headroom $(SBU) --models models/sbu --azimuths 6 --polars 4 --out runs/headroom-sbu-perfect
	$(RUN)ehar train recogniser $(HDM05) --out models/hdm05 --form ctrgcn
	$(RUN)ehar train recogniser --data duo --out models/duo --form ctrgcn
	for form in causal ctrgcn; do \
	  $(RUN)ehar benchmark no-act $(HDM05) --models models/hdm05 --form $$form --starts 2 --no-report --out runs/form-hdm05-$$form && \
	  $(RUN)ehar benchmark no-act --data duo --models models/duo --form $$form --starts 2 --no-report --out runs/form-duo-$$form \
	  || exit 1; done
	$(call side_by_side,planners,All planners through the estimator,$(SETS:%=runs/agents-%-estimator),il-ppo)
	$(call side_by_side,nbv,nbv against the others through the estimator,$(SETS:%=runs/agents-%-estimator),nbv)
	$(call side_by_side,exact-joints,Planners with exact joints,$(SETS:%=runs/nbv-%-perfect),nbv)
	$(call side_by_side,conditions,Two synthetic sets under three conditions,$(CONDITIONS),il-ppo)
	$(call side_by_side,flown,All planners in flight on single clips,$(SETS:%=runs/agents-%-drone),nbv)
	$(call page,flight-solo,Flight over 2.5 seconds of solo,ehar benchmark $(RULES) oracle $(LONG) --track px4-auto,\
	  $(foreach track,ideal $(VEHICLES),runs/flight-solo-$(track)/table.md))
	$(call page,ablation-sbu,What each part and setting of nbv is worth on sbu,ehar study ablation $(SBU) --sensor estimator,\
	  runs/ablation-sbu-estimator/table.md)
	$(call page,belief,The belief against the recogniser,ehar study belief --data duo --sensor estimator,\
	  $(foreach sensor,estimator perfect,$(SETS:%=runs/belief-%-$(sensor)/table.md)))
	$(call page,headroom,What there is to win,ehar study headroom $(SBU) --models models/sbu --azimuths 6 --polars 4,\
	  runs/headroom-*/table.md)
	$(call page,forms,The streaming form against the published one,ehar benchmark no-act --data duo --form ctrgcn --starts 2,\
	  runs/form-*/table.md)
	cp runs/agents-hdm05-estimator/analysis/*.png docs/results
	$(call page,behaviour,Where the agent goes,ehar study analyse runs/agents-hdm05-estimator --planners il-ppo nbv,\
	  runs/agents-hdm05-estimator/analysis/analysis.md)
	$(call page,agents,What parts and options of the learned agent are worth,ehar benchmark no-act il il-ppo oracle,\
	  runs/encoders-solo-paper/table.md runs/imitation-solo-*/table.md runs/policy-*/table.md runs/dagger-ppo-duo-*/table.md)
	$(call page,benchmarks,Every planner on every set with all columns,ehar benchmark $(PLANNERS) --data duo --sensor estimator,\
	  runs/agents-*-estimator/table.md runs/nbv-*-perfect/table.md)

clean:
	rm -rf $(VENV)
