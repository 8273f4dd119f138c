# Everything needs only Python >= 3.11, make and a package index. `.venv` is made once, beside this file.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/
# Extras of pyproject.toml that are installed; .ci/run asks for more.
EXTRAS ?= dev

.PHONY: setup benchmark test fuzz lint docs weights results pages left clean

setup: $(VENV)/.installed

# torch first and by itself: its exact version decides which build the index hands out. pip would take half of its time
# to compile all modules on one core. All cores do it here, without packages' own tests and what hardly anybody imports,
# together nearly half of the work; a few files are templates and cannot be compiled.
$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "ehar needs Python 3.11 or newer, this is " + sys.version)'
	$(PYTHON) -m venv $(VENV)
	$(RUN)python -m pip install --quiet --upgrade pip
	$(RUN)python -m pip install --quiet --no-compile --constraint constraints.txt torch==2.13.0
	$(RUN)python -m pip install --quiet --no-compile --constraint constraints.txt --editable '.[$(EXTRAS)]'
	$(RUN)python -m compileall -qq -j 0 -x '/(tests|testing|mypyc?|_inductor|graph_objs|debugpy|rllib|dialects)/' $(VENV)/lib || true
	touch $@

benchmark: setup
	$(RUN)ehar benchmark --data solo --sensor estimator --out runs/solo-estimator
	$(RUN)ehar benchmark no-act h-rotate front fixed-best nbv-greedy nbv oracle --data solo-stream --sensor estimator --out runs/solo-stream

# Two processes whose linear algebra has two threads each wait for one another: a fit of 0.8 s took three minutes.
test fuzz: export OPENBLAS_NUM_THREADS = 1
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

# --- weights and results: file targets, so a run that was stopped goes on where it was, and -j runs what is independent.
# LAUNCH comes before every command, for a cluster: make -j 20 results LAUNCH="srun --ntasks=1". ENGINE is where the jobs
# of each benchmark run: make results ENGINE="--engine ray --address auto". `make left` says what is left of the results.
# A model set is NAME, NAME-SEED or NAME-indoor: models/duo-1 is the second training on duo, models/sbu-indoor the world of
# a robot indoors. DATA is a folder with hdm05, bandai2, sbu, nwucla, utkinect and kindergator.npz. SEEDS are
# the agents' seeds, by name: another machine may train others into the same folder, SEEDS="5 6".
LAUNCH ?=
ENGINE ?=
EHAR := $(LAUNCH) $(RUN)ehar
BENCHMARK := $(EHAR) benchmark $(ENGINE)
DATA ?= ../shared/data
STARTS ?= 5
SEEDS ?= 0 1 2 3 4

duo := --data duo
solo := --data solo
hdm05 := --data $(DATA)/hdm05.npz
bandai2 := --data $(DATA)/bandai2.npz
sbu := --data $(DATA)/sbu.npz --fps 30 --length 30
kindergator := --data $(DATA)/kindergator.npz --fps 10 --length 50
SETS := duo solo hdm05 bandai2 sbu
TRAININGS := duo duo-1 duo-2 solo solo-1 solo-2 hdm05 bandai2 sbu hdm05-indoor sbu-indoor kindergator

# The rules name every file (static patterns): make would pass over files that only patterns name.
# Of a model set $(1): its data, and the seed of its trainings.
data_of = $($(firstword $(subst -, ,$(1)))) $(if $(filter indoor,$(subst -, ,$(1))),--world indoor)
seed_of = $(or $(filter-out indoor,$(word 2,$(subst -, ,$(1)))),0)
train_options = $(call data_of,$(1)) --seed $(call seed_of,$(1))

RULES := no-act random towards h-rotate v-rotate near-level front side fixed-best nbv-greedy nbv-search nbv
AGENTS := il ppo il-ppo dagger
ORACLES := oracle oracle-lookahead
VEHICLES := px4-auto px4-max tracking-drone
space := $(subst ,, )
OF_SEEDS := seeds-$(subst $(space),-,$(strip $(SEEDS)))

.DELETE_ON_ERROR:

# A target is what its command writes last, as a command that was killed may have written all else: weights after the JSON
# beside them, table.md after the other files of a run or a study. Where that is no single file, touch comes last.

# Recognisers. The first one of a set is trained from scratch, through the estimator; the others begin with its weights.
$(TRAININGS:%=models/%/causal-estimator-moving.safetensors): models/%/causal-estimator-moving.safetensors: | setup
	$(EHAR) train recogniser $(call train_options,$*) --sensor estimator --out $(@D)

$(TRAININGS:%=models/%/causal-perfect-moving.safetensors): models/%/causal-perfect-moving.safetensors: models/%/causal-estimator-moving.safetensors
	$(EHAR) train recogniser $(call train_options,$*) --init $< --out $(@D)

# Gain fields, the places of fixed-best, and agents, each for its recogniser: perfect-moving, estimator-moving, ...
define planner_weights
$$(TRAININGS:%=models/%/gain-field-$(1)-$(2).safetensors): models/%/gain-field-$(1)-$(2).safetensors: models/%/causal-$(1)-$(2).safetensors
	$$(EHAR) train gain-field $$(call train_options,$$*) --sensor $(1) --views $(2) --models $$(@D)

$$(TRAININGS:%=models/%/fixed-best-$(1)-$(2).json): models/%/fixed-best-$(1)-$(2).json: models/%/causal-$(1)-$(2).safetensors
	$$(EHAR) train fixed-best $$(call train_options,$$*) --sensor $(1) --views $(2) --models $$(@D)

$$(TRAININGS:%=models/%/agents-$(1)-$(2)-$(OF_SEEDS)): models/%/agents-$(1)-$(2)-$(OF_SEEDS): models/%/causal-$(1)-$(2).safetensors
	$$(EHAR) train agent $$(call data_of,$$*) --sensor $(1) --views $(2) --models $$(@D) --seeds $$(SEEDS)
	touch $$@

$$(TRAININGS:%=models/%/planners-$(1)-$(2)): models/%/planners-$(1)-$(2): models/%/gain-field-$(1)-$(2).safetensors models/%/fixed-best-$(1)-$(2).json
	touch $$@

$$(TRAININGS:%=models/%/all-$(1)-$(2)): models/%/all-$(1)-$(2): models/%/planners-$(1)-$(2) models/%/agents-$(1)-$(2)-$(OF_SEEDS)
	touch $$@
endef
$(eval $(call planner_weights,estimator,moving))
$(eval $(call planner_weights,perfect,moving))

# The weights that ship in recognition/weights and planners/weights, trained anew into models.
weights: $(foreach set,duo solo,$(foreach seen,estimator-moving perfect-moving,models/$(set)/planners-$(seen))) \
  models/solo-stream/planners models/duo-stream/planners

# Recognisers that learned for fewer clips, and their planners: curve-duo-15000.
CURVE_CLIPS := 7500 15000 30000 60000
CURVES := $(foreach set,duo hdm05,$(CURVE_CLIPS:%=$(set)-%))

CURVE := models/curve-%/causal-estimator-moving.safetensors
$(CURVES:%=$(CURVE)): $(CURVE): | setup
	$(EHAR) train recogniser $(call data_of,$*) --sensor estimator --clips $(word 2,$(subst -, ,$*)) --out $(@D)

$(CURVES:%=models/curve-%/trained): models/curve-%/trained: $(CURVE)
	$(EHAR) train gain-field $(call data_of,$*) --sensor estimator --models $(@D)
	$(EHAR) train fixed-best $(call data_of,$*) --sensor estimator --models $(@D)
	touch $@

$(CURVES:%=runs/curve-%/table.md): runs/curve-%/table.md: models/curve-%/trained
	$(BENCHMARK) $(RULES) oracle $(call data_of,$*) --sensor estimator --models models/curve-$* --starts $(STARTS) \
	  --no-report --out $(@D)

# Runs. agents: every planner; rules: every planner that is not an agent; each through a sensor, on a track.
$(TRAININGS:%=runs/rules-%-estimator/table.md): runs/rules-%-estimator/table.md: models/%/planners-estimator-moving
	$(BENCHMARK) $(RULES) $(ORACLES) $(call data_of,$*) --sensor estimator --models models/$* --starts $(STARTS) \
	  --out $(@D)

$(SETS:%=runs/rules-%-perfect/table.md): runs/rules-%-perfect/table.md: models/%/planners-perfect-moving
	$(BENCHMARK) $(RULES) $(ORACLES) $(call data_of,$*) --sensor perfect --models models/$* --starts $(STARTS) \
	  --out $(@D)

$(SETS:%=runs/agents-%-estimator/table.md): runs/agents-%-estimator/table.md: models/%/all-estimator-moving
	$(BENCHMARK) $(RULES) $(AGENTS) $(ORACLES) $(call data_of,$*) --sensor estimator --models models/$* \
	  --starts $(STARTS) --out $(@D)

$(SETS:%=runs/rules-%-drone/table.md): runs/rules-%-drone/table.md: runs/rules-%-estimator/table.md
	$(BENCHMARK) $(RULES) $(ORACLES) $(call data_of,$*) --sensor estimator --models models/$* --starts $(STARTS) \
	  --track tracking-drone --ideal $(<D) --out $(@D)

runs/trainings-duo/table.md runs/trainings-solo/table.md: runs/trainings-%/table.md: \
  runs/rules-%-estimator/table.md runs/rules-%-1-estimator/table.md \
  runs/rules-%-2-estimator/table.md
	$(EHAR) study trainings $(^:/table.md=) --out $(@D)

$(SETS:%=runs/belief-%/table.md): runs/belief-%/table.md: models/%/planners-estimator-moving
	$(EHAR) study belief $(call data_of,$*) --sensor estimator --models models/$* --out $(@D)

# Streams, synthetic ones and those of a real Kinect, with every planner that is not an agent: on the grid, and flown.
STREAMS := solo-stream duo-stream utkinect
FLYING := px4-auto tracking-drone
utkinect := --data $(DATA)/utkinect.npz
stream_data = $(or $($(1)),--data $(1))
WATCHING := no-act h-rotate near-level front side fixed-best nbv-greedy nbv-search nbv oracle

# The recognisers that ship learn in the open first, and then go on with things in the way.
STREAM_RECOGNISER := models/%/causal-estimator-moving.safetensors
OPEN_RECOGNISER := models/%/open/causal-estimator-moving.safetensors
SHIPPED_STREAMS := solo-stream duo-stream
models/utkinect/causal-estimator-moving.safetensors $(SHIPPED_STREAMS:%=$(OPEN_RECOGNISER)): | setup
	$(EHAR) train recogniser $(call stream_data,$(word 2,$(subst /, ,$@))) --sensor estimator --out $(@D)

$(SHIPPED_STREAMS:%=$(STREAM_RECOGNISER)): $(STREAM_RECOGNISER): $(OPEN_RECOGNISER)
	$(EHAR) train recogniser $(call stream_data,$*) --sensor estimator --in-the-way --init $< --out $(@D)

$(STREAMS:%=models/%/planners): models/%/planners: $(STREAM_RECOGNISER)
	$(EHAR) train gain-field $(call stream_data,$*) --sensor estimator --models $(@D)
	$(EHAR) train fixed-best $(call stream_data,$*) --sensor estimator --models $(@D)
	touch $@

$(STREAMS:%=runs/watched-%/table.md): runs/watched-%/table.md: models/%/planners
	$(BENCHMARK) $(WATCHING) $(call stream_data,$*) --sensor estimator --models models/$* --starts $(STARTS) --out $(@D)

define watched_in_flight
$$(STREAMS:%=runs/watched-%-$(1)/table.md): runs/watched-%-$(1)/table.md: runs/watched-%/table.md
	$$(BENCHMARK) $$(WATCHING) $$(call stream_data,$$*) --sensor estimator --models models/$$* --starts $$(STARTS) \
	  --track $(1) --ideal $$(<D) --out $$(@D)
endef
$(foreach vehicle,$(FLYING),$(eval $(call watched_in_flight,$(vehicle))))

SYNTHETIC := solo-stream duo-stream

# Things in the way: three trainings of the open world.
IN_THE_WAY := room crowd
WORLDS := paper $(IN_THE_WAY)
OF_SOLO := solo solo-1 solo-2
define in_the_way
$$(OF_SOLO:%=runs/$(1)-%/table.md): runs/$(1)-%/table.md: models/%/planners-estimator-moving
	$$(BENCHMARK) $$(RULES) oracle --data solo --sensor estimator --world $(1) --models models/$$* --out $$(@D)

runs/trainings-$(1)/table.md: $$(OF_SOLO:%=runs/$(1)-%/table.md)
	$$(EHAR) study trainings $$(^:/table.md=) --out $$(@D)
endef
$(foreach world,$(IN_THE_WAY),$(eval $(call in_the_way,$(world))))

# Streams among them: on the grid, and flown. The greedy oracle thinks of one frame, and a wall is wider than that.
AMONG := $(filter-out oracle,$(WATCHING))
define among
$$(SYNTHETIC:%=runs/$(1)-%/table.md): runs/$(1)-%/table.md: models/%/planners
	$$(BENCHMARK) $$(AMONG) --data $$* --sensor estimator --world $(1) --models models/$$* --starts 3 --out $$(@D)
endef
define flown_among
$$(SYNTHETIC:%=runs/$(1)-%-$(2)/table.md): runs/$(1)-%-$(2)/table.md: runs/$(1)-%/table.md
	$$(BENCHMARK) $$(AMONG) --data $$* --sensor estimator --world $(1) --models models/$$* --starts 3 \
	  --track $(2) --ideal $$(<D) --out $$(@D)
endef
$(foreach world,$(IN_THE_WAY),$(eval $(call among,$(world)))$(foreach track,$(FLYING),$(eval $(call flown_among,$(world),$(track)))))

# Looking at recorded people: utkinect, and what is stitched of the others, everybody tested once. Most of sbu's streams are
# shorter than 30 s.
RECORDED := sbu-stream hdm05-stream utkinect kindergator-stream
NUMBERS := 0 1 2
FOLDS := $(foreach set,$(RECORDED),$(NUMBERS:%=$(set)-%))
LOOKING := no-act h-rotate near-level front fixed-best nbv-greedy nbv-search nbv
whole = $(or $(filter-out --data,$($(1))),streams/$(1).npz)
rate = $(if $(filter hdm05-stream-%,$(1)),--fps 30)$(if $(filter kindergator-stream-%,$(1)),--fps 10)
lasting = $(if $(filter sbu-stream-%,$(1)),--length 368)
watched = --data streams/$(1).npz $(call rate,$(1)) --sensor estimator --models models/$(1) $(call lasting,$(1))
looked = $(watched) --starts 3

STITCHED := hdm05 sbu kindergator
$(STITCHED:%=streams/%-stream.npz): streams/%-stream.npz: | setup
	$(EHAR) data stitch $(DATA)/$*.npz --out $@

define fold_of
streams/$(1)-$(2).npz: $(filter streams/%,$(call whole,$(1))) | setup
	$$(EHAR) data fold $(call whole,$(1)) --number $(2) --out $$@
endef
$(foreach set,$(RECORDED),$(foreach number,$(NUMBERS),$(eval $(call fold_of,$(set),$(number)))))

# Recognisers of hdm05 learn in the open first, as those that ship do, and those of kindergator there alone: its activities
# last 5 s, so its windows do 8 s.
OPEN_FIRST := $(filter hdm05-%,$(FOLDS))
$(OPEN_FIRST:%=$(OPEN_RECOGNISER)): $(OPEN_RECOGNISER): streams/%.npz
	$(EHAR) train recogniser --data $< $(call rate,$*) --sensor estimator --out $(@D)

$(OPEN_FIRST:%=$(STREAM_RECOGNISER)): $(STREAM_RECOGNISER): $(OPEN_RECOGNISER) streams/%.npz
	$(EHAR) train recogniser --data $(word 2,$^) $(call rate,$*) --sensor estimator --in-the-way --init $< --out $(@D)

AT_ONCE := $(filter-out $(OPEN_FIRST),$(FOLDS))
$(AT_ONCE:%=$(STREAM_RECOGNISER)): $(STREAM_RECOGNISER): streams/%.npz
	$(EHAR) train recogniser --data $< $(call rate,$*) $(if $(filter kindergator-%,$*),--length 80,--in-the-way) --sensor estimator --out $(@D)

$(FOLDS:%=models/%/planners): models/%/planners: $(STREAM_RECOGNISER)
	$(EHAR) train gain-field --data streams/$*.npz $(call rate,$*) --sensor estimator --models $(@D)
	$(EHAR) train fixed-best --data streams/$*.npz $(call rate,$*) $(call lasting,$*) --sensor estimator --models $(@D)
	touch $@

# No vehicle keeps up with all people of hdm05: tracking-drone does with those of folds 1 and 2.
FLOWN := sbu-stream utkinect kindergator-stream
define looked_at
$$(FOLDS:%=runs/looked-%-$(1)/table.md): runs/looked-%-$(1)/table.md: models/%/planners
	$$(BENCHMARK) $$(LOOKING) $$(call looked,$$*) --world $(1) --out $$(@D)

$$(RECORDED:%=runs/looked-%-$(1)/table.md): runs/looked-%-$(1)/table.md: $$(NUMBERS:%=runs/looked-\%-%-$(1)/table.md)
	$$(EHAR) study folds $$(^:/table.md=) --out $$(@D)
endef
$(foreach world,$(WORLDS),$(eval $(call looked_at,$(world))))

define flown_through
$$(FOLDS:%=runs/looked-%-$(1)-$(2)/table.md): runs/looked-%-$(1)-$(2)/table.md: runs/looked-%-$(1)/table.md
	$$(BENCHMARK) $$(LOOKING) $$(call looked,$$*) --world $(1) --track $(2) --ideal $$(<D) --out $$(@D)

$$(FLOWN:%=runs/looked-%-$(1)-$(2)/table.md): runs/looked-%-$(1)-$(2)/table.md: runs/looked-%-$(1)/table.md \
  $$(NUMBERS:%=runs/looked-\%-%-$(1)-$(2)/table.md)
	$$(EHAR) study folds $$(patsubst %/table.md,%,$$(wordlist 2,9,$$^)) --ideal $$(<D) --out $$(@D)
endef
$(foreach track,$(FLYING),$(foreach world,$(WORLDS),$(eval $(call flown_through,$(world),$(track)))))

define two_folds
runs/looked-two-$(1)/table.md: runs/looked-hdm05-stream-1-$(1)/table.md runs/looked-hdm05-stream-2-$(1)/table.md
	$$(EHAR) study folds $$(^:/table.md=) --out $$(@D)

runs/looked-two-$(1)-tracking-drone/table.md: runs/looked-two-$(1)/table.md \
  runs/looked-hdm05-stream-1-$(1)-tracking-drone/table.md runs/looked-hdm05-stream-2-$(1)-tracking-drone/table.md
	$$(EHAR) study folds $$(patsubst %/table.md,%,$$(wordlist 2,3,$$^)) --ideal $$(<D) --out $$(@D)
endef
$(foreach world,$(WORLDS),$(eval $(call two_folds,$(world))))

# What learned in flight: a gain field, and agents that copy flights of an oracle. Flights take them where there are any, so
# they have a folder of their own.
COMMA := ,
TAUGHT_ALOFT := sbu-stream utkinect
ALOFT := $(SYNTHETIC) $(foreach set,$(TAUGHT_ALOFT),$(NUMBERS:%=$(set)-%))
of_stream = --data $(if $(filter $(1),$(FOLDS)),streams/$(1).npz,$(1)) --sensor estimator
aloft = $(call of_stream,$(1)) --track px4-auto --models models/$(1)-flown
$(ALOFT:%=models/%-flown/planners): models/%-flown/planners: models/%/planners
	mkdir -p $(@D) && cp models/$*/causal-* models/$*/fixed-best-* $(@D)
	$(EHAR) train gain-field $(call aloft,$*)
	$(EHAR) train agent $(call aloft,$*) --stages il$(if $(filter solo-stream,$*),$(COMMA)ppo$(COMMA)il-ppo$(COMMA)dagger) --seeds 0 1 2
	touch $@

# Agents that learned in the room, beside the grid's field.
TAUGHT_THERE := $(SYNTHETIC) $(NUMBERS:%=sbu-stream-%)
there = $(call of_stream,$(1)) --track px4-auto --world room --models models/$(1)-there
$(TAUGHT_THERE:%=models/%-there/planners): models/%-there/planners: models/%/planners
	mkdir -p $(@D) && cp models/$*/causal-* models/$*/gain-field-*.* models/$*/fixed-best-* $(@D)
	$(EHAR) train agent $(call there,$*) --stages il --seeds 0 1 2
	touch $@

ALOFT_PLANNERS := no-act h-rotate front fixed-best il nbv-search nbv
define learned_aloft
$$(ALOFT:%=runs/aloft-%-$(1)/table.md): runs/aloft-%-$(1)/table.md: models/%-flown/planners
	$$(BENCHMARK) $$(ALOFT_PLANNERS) $$(if $$(filter solo-stream,$$*),ppo il-ppo dagger oracle oracle-lookahead) $$(call aloft,$$*) $$(call lasting,$$*) --world $(1) --starts 3 --out $$(@D)

$$(TAUGHT_ALOFT:%=runs/aloft-%-$(1)/table.md): runs/aloft-%-$(1)/table.md: $$(NUMBERS:%=runs/aloft-\%-%-$(1)/table.md)
	$$(EHAR) study folds $$(^:/table.md=) --out $$(@D)
endef
$(foreach world,paper room,$(eval $(call learned_aloft,$(world))))

$(TAUGHT_THERE:%=runs/there-%/table.md): runs/there-%/table.md: models/%-there/planners
	$(BENCHMARK) $(ALOFT_PLANNERS) $(call there,$*) $(call lasting,$*) --starts 3 --out $(@D)

runs/there-sbu-stream/table.md: $(NUMBERS:%=runs/there-sbu-stream-%/table.md)
	$(EHAR) study folds $(^:/table.md=) --out $(@D)

# What it costs if passers-by are taken for those that are watched: the world is the example of the docs.
runs/mistaken.json: docs/worlds.md
	mkdir -p $(@D) && sed -n '/^## Whose joints are whose/,/^## How/p' $< | sed -n '/^{/,/^}/p' > $@

$(SYNTHETIC:%=runs/mistaken-%/table.md): runs/mistaken-%/table.md: runs/mistaken.json models/%/planners
	$(BENCHMARK) $(AMONG) --data $* --sensor estimator --world $< --models models/$* --starts 3 --out $(@D)

$(SYNTHETIC:%=runs/compared-%/table.md): runs/compared-%/table.md: runs/crowd-%/table.md runs/mistaken-%/table.md
	$(EHAR) compare $(^:/table.md=) --out $(@D)

# Passers-by whom cameras meet: the world is the example of the docs.
runs/street.json: docs/worlds.md
	mkdir -p $(@D) && sed -n '/^## Passers-by whom/,/^## Whose/p' $< | sed -n '/^{/,/^}/p' > $@

MEETING := no-act near-level front fixed-best nbv-search nbv --data solo-stream --sensor estimator --world runs/street.json \
  --models models/solo-stream --starts 1
runs/street/table.md: runs/street.json models/solo-stream/planners
	$(BENCHMARK) $(MEETING) --out $(@D)

$(FLYING:%=runs/street-%/table.md): runs/street-%/table.md: runs/street/table.md
	$(BENCHMARK) $(MEETING) --track $* --ideal $(<D) --out $(@D)

# Flights that pay for energy, for noise near people, and for their length.
PRICED := $(foreach price,energy_weight-0.1 energy_weight-1 noise_weight-0.1 distance_weight-0.001 distance_weight-0.01, \
  planners.search.next_best_view:NextBestView --$(subst -, ,$(price)) --name nbv-$(price))
runs/priced-solo-stream/table.md: models/solo-stream/planners
	$(BENCHMARK) no-act front nbv-search nbv $(PRICED) --data solo-stream --sensor estimator --models models/solo-stream \
	  --track px4-auto --starts 3 --out $(@D)

# What it costs if people are localised worse than the recogniser was told: the world is the example of the docs.
runs/worse.json: docs/worlds.md
	mkdir -p $(@D) && sed -n '/^## How people are localised/,/^## What/p' $< | sed -n '/^{/,/^}/p' > $@

LOCALISED := no-act front nbv --data solo-stream --sensor estimator --models models/solo-stream
runs/localised-worse/table.md: runs/worse.json models/solo-stream/planners
	$(BENCHMARK) $(LOCALISED) --world $< --out $(@D)

runs/localised-usual/table.md: models/solo-stream/planners
	$(BENCHMARK) $(LOCALISED) --out $(@D)

runs/localised/table.md: runs/localised-worse/table.md runs/localised-usual/table.md
	$(EHAR) compare $(^:/table.md=) --out $(@D)

# Three trainings of synthetic streams: in the open and in a room, on the grid and flown.
SEEDED := $(foreach set,$(SYNTHETIC),$(NUMBERS:%=$(set)-%))
seed_number = $(lastword $(subst -, ,$(1)))
seeded = --data $(patsubst %-$(call seed_number,$(1)),%,$(1)) --sensor estimator
LOOKED_BY_SEED := no-act h-rotate fixed-best nbv-search nbv
$(SEEDED:%=$(STREAM_RECOGNISER)): $(STREAM_RECOGNISER): | setup
	$(EHAR) train recogniser $(call seeded,$*) --seed $(call seed_number,$*) --out $(@D)

$(SEEDED:%=models/%/planners): models/%/planners: $(STREAM_RECOGNISER)
	$(EHAR) train gain-field $(call seeded,$*) --seed $(call seed_number,$*) --models $(@D)
	$(EHAR) train fixed-best $(call seeded,$*) --models $(@D)
	touch $@

define of_seeds
$$(SEEDED:%=runs/seeded-%-$(1)/table.md): runs/seeded-%-$(1)/table.md: models/%/planners
	$$(BENCHMARK) $$(LOOKED_BY_SEED) $$(call seeded,$$*) --models models/$$* --world $(1) --out $$(@D)

$$(SEEDED:%=runs/seeded-%-$(1)-px4-auto/table.md): runs/seeded-%-$(1)-px4-auto/table.md: runs/seeded-%-$(1)/table.md
	$$(BENCHMARK) $$(LOOKED_BY_SEED) $$(call seeded,$$*) --models models/$$* --world $(1) --track px4-auto --ideal $$(<D) --out $$(@D)

$$(SYNTHETIC:%=runs/seeded-%-$(1)/table.md): runs/seeded-%-$(1)/table.md: $$(NUMBERS:%=runs/seeded-\%-%-$(1)/table.md)
	$$(EHAR) study trainings $$(^:/table.md=) --out $$(@D)

$$(SYNTHETIC:%=runs/seeded-%-$(1)-px4-auto/table.md): runs/seeded-%-$(1)-px4-auto/table.md: \
  $$(NUMBERS:%=runs/seeded-\%-%-$(1)-px4-auto/table.md)
	$$(EHAR) study trainings $$(^:/table.md=) --out $$(@D)
endef
$(foreach world,room paper,$(eval $(call of_seeds,$(world))))

# What nbv gains by knowing what is believed, what was seen, and where people face.
$(FOLDS:%=runs/knowledge-%/table.md): runs/knowledge-%/table.md: models/%/planners
	$(EHAR) study ablation $(call looked,$*) --groups knowledge --out $(@D)

$(RECORDED:%=runs/knowledge-%/table.md): runs/knowledge-%/table.md: $(NUMBERS:%=runs/knowledge-\%-%/table.md)
	$(EHAR) study folds $(^:/table.md=) --out $(@D)

$(SYNTHETIC:%=runs/knowledge-%/table.md): runs/knowledge-%/table.md: models/%/planners
	$(EHAR) study ablation $(call stream_data,$*) --sensor estimator --models models/$* --starts $(STARTS) --groups knowledge --out $(@D)

# What the belief wins, and what an unknown onset costs: three trainings of synthetic streams, or three folds of recorded ones.
HEARD := $(SYNTHETIC) $(RECORDED)
HEARD_ONCE := $(SEEDED) $(FOLDS)
heard = $(if $(filter $(1),$(SEEDED)),$(call seeded,$(1)) --models models/$(1),$(call watched,$(1)))
HOW := belief known unknown
$(HEARD_ONCE:%=runs/belief-%/table.md): runs/belief-%/table.md: $(STREAM_RECOGNISER)
	$(EHAR) study belief $(call heard,$*) --out $(@D)

define of_onset
$$(HEARD_ONCE:%=runs/$(1)-%/table.md): runs/$(1)-%/table.md: $$(STREAM_RECOGNISER)
	$$(BENCHMARK) no-act random h-rotate $$(call heard,$$*) --onset $(1) --no-report --out $$(@D)
endef
$(foreach onset,known unknown,$(eval $(call of_onset,$(onset))))

define heard_together
$$(SYNTHETIC:%=runs/$(1)-%/table.md): runs/$(1)-%/table.md: $$(NUMBERS:%=runs/$(1)-\%-%/table.md)
	$$(EHAR) study trainings $$(^:/table.md=) --planner h-rotate --out $$(@D)

$$(filter-out $$(SYNTHETIC:%=runs/$(1)-%/table.md),$$(HEARD:%=runs/$(1)-%/table.md)): runs/$(1)-%/table.md: $$(NUMBERS:%=runs/$(1)-\%-%/table.md)
	$$(EHAR) study folds $$(^:/table.md=) --out $$(@D)
endef
$(foreach how,$(HOW),$(eval $(call heard_together,$(how))))

$(HEARD:%=runs/onset-%/table.md): runs/onset-%/table.md: runs/known-%/table.md runs/unknown-%/table.md
	$(EHAR) compare $(^:/table.md=) --out $(@D)

# When to answer in synthetic streams, on the recogniser's words and on the belief's: rules are fitted on the policy part.
define decided_in_streams
$$(SEEDED:%=runs/answers-$(1)-%/table.md): runs/answers-$(1)-%/table.md: models/%/planners
	$$(BENCHMARK) no-act nbv $$(call heard,$$*) --readout $(1) --no-report --out $$(@D)

$$(SEEDED:%=runs/taught-$(1)-%/table.md): runs/taught-$(1)-%/table.md: models/%/planners
	$$(BENCHMARK) no-act nbv $$(call heard,$$*) --readout $(1) --part policy --starts 2 --no-report --out $$(@D)

$$(SYNTHETIC:%=runs/answers-$(1)-%/table.md) $$(SYNTHETIC:%=runs/taught-$(1)-%/table.md): %/table.md: $$(NUMBERS:%=\%-%/table.md)
	$$(EHAR) study trainings $$(^:/table.md=) --out $$(@D)

$$(SYNTHETIC:%=runs/decided-$(1)-%/table.md): runs/decided-$(1)-%/table.md: runs/answers-$(1)-%/table.md runs/taught-$(1)-%/table.md
	$$(EHAR) study decide runs/answers-$(1)-$$* --fitted-on runs/taught-$(1)-$$* --out $$(@D)
endef
$(foreach words,recogniser belief,$(eval $(call decided_in_streams,$(words))))

# In recorded streams the rules of each fold are fitted on the others.
$(RECORDED:%=runs/decided-%/table.md): runs/decided-%/table.md: runs/looked-%-paper/table.md
	$(EHAR) study decide $(<D) --planners no-act nbv --out $(@D)

# The film of the README: the episode in which nbv's gain over front is nearest to its median, and of it the most activities.
docs/figures/stream.gif: runs/watched-utkinect-px4-auto/table.md
	$(EHAR) replay $(<D) typical --planners nbv front --since 8 --until 18 --out $@

# The film of passers-by: three seconds of the episode in which nbv gains most over a camera that only follows.
docs/figures/crowd.gif: runs/crowd-solo-stream-px4-auto/table.md
	$(EHAR) replay $(<D) gain --planners nbv no-act --since 18 --until 21 --out $@

# The film of a join: an episode of Kinder-Gator in which one motion leads to the next from 17.1 to 17.8 s.
docs/figures/join.gif: runs/unknown-kindergator-stream-0/table.md
	$(EHAR) replay $(<D) 4 --planners no-act --since 15.6 --until 19.4 --slower 2 --out $@

# Episodes of validation people, on which rules of when to answer are fitted.
$(SETS:%=runs/fitting-%/table.md): runs/fitting-%/table.md: models/%/planners-estimator-moving
	$(BENCHMARK) no-act nbv $(call data_of,$*) --sensor estimator --models models/$* --part validation --starts $(STARTS) \
	  --no-report --out $(@D)

$(SETS:%=runs/headroom-%/table.md): runs/headroom-%/table.md: models/%/causal-estimator-moving.safetensors
	$(EHAR) study headroom $(call data_of,$*) --sensor estimator --models models/$* --azimuths 6 --polars 3 --out $(@D)

MAPPED := solo hdm05
$(MAPPED:%=runs/class-maps-%/table.md): runs/class-maps-%/table.md: models/%/causal-estimator-moving.safetensors
	$(EHAR) study headroom $(call data_of,$*) --sensor estimator --models models/$* --azimuths 8 --polars 3 --out $(@D)

$(SETS:%=runs/ablation-%/table.md): runs/ablation-%/table.md: models/%/planners-estimator-moving
	$(EHAR) study ablation $(call data_of,$*) --sensor estimator --models models/$* --starts $(STARTS) \
	  --tracks $(VEHICLES) --out $(@D)

# The paper's setting: the published network at PAPER_SIZE, its optimiser, and agents as the paper trains them. Where no
# GPU is at hand, PAPER_SIZE=half and PAPER_AGENTS="--episodes 1500 --frames 500000 --seeds 0" take hours, not days.
PAPER_SIZE ?= published
PAPER_AGENTS ?= --seeds $(SEEDS)
PAPER := --views paper --form ctrgcn
LEFT_OUT := embedding log-probs time vision position
PAPER_PLANNERS := no-act random towards h-rotate v-rotate il ppo il-ppo $(LEFT_OUT:%=il-ppo-no-%) oracle

PAPER_SETS := duo solo
PAPER_NETWORK := models/paper-%/ctrgcn-perfect-paper.safetensors
$(PAPER_SETS:%=$(PAPER_NETWORK)): $(PAPER_NETWORK): | setup
	$(EHAR) train recogniser $($*) $(PAPER) --size $(PAPER_SIZE) --optimiser published --batch 64 --clips 200000 --out $(@D)

$(PAPER_SETS:%=models/paper-%/trained): models/paper-%/trained: $(PAPER_NETWORK)
	$(EHAR) train agent $($*) $(PAPER) --models $(@D) --setting paper $(PAPER_AGENTS)
	for part in $(LEFT_OUT); do $(EHAR) train agent $($*) $(PAPER) --models $(@D) --setting paper $(PAPER_AGENTS) \
	  --stages il,il-ppo --without $$part || exit 1; done
	touch $@

$(PAPER_SETS:%=runs/paper-%/table.md): runs/paper-%/table.md: models/paper-%/trained
	$(BENCHMARK) $(PAPER_PLANNERS) $($*) $(PAPER) --models models/paper-$* --starts $(STARTS) --out $(@D)

$(PAPER_SETS:%=runs/paper-%/analysis/analysis.md): runs/paper-%/analysis/analysis.md: runs/paper-%/table.md
	$(EHAR) study analyse $(<D) --planners il-ppo --states il-ppo/0

# The published protocol on Northwestern-UCLA. Published widths want a GPU: PUBLISHED_SIZE=small takes hours on two cores.
PUBLISHED_SIZE ?= published
PUBLISHED_DEVICE ?= cuda
runs/published/table.md: | setup
	$(EHAR) study published $(DATA)/nwucla.npz --size $(PUBLISHED_SIZE) --device $(PUBLISHED_DEVICE) --seeds 0 1 2 --out $(@D)

runs/real-views/table.md: | setup
	$(EHAR) study real-views $(DATA)/nwucla.npz --out $(@D)

# What each part of a recogniser's training is worth: 15 trainings for each set and fold, with the clips of each set in turn.
TRIAL_SETS := $(DATA)/sbu.npz $(DATA)/nwucla.npz $(DATA)/hdm05.npz solo duo
TRIAL_CLIPS ?= 30400 30400 115776 60000 60000
runs/trials/table.md: | setup
	$(EHAR) study trials $(TRIAL_SETS) --clips $(TRIAL_CLIPS) --out $(@D)

# Write the page $(1) with the title $(2): the command $(3), when it ran, and the tables $(4).
page = { printf '%s\n' '\# $(2)' '' '```' '$(3)' '```' '' \
  "Measured on $$(date +%F), at commit $$(git rev-parse --short HEAD). \`make results\` runs all of it again and writes this" \
  'page. [What these figures are](../results.md\#what-these-figures-are) says how to read them.' ''; \
  for table in $(4); do cat $$table && echo || exit 1; done; } > $(1).part && mv $(1).part $(1)

# Put the runs that a page depends on side by side, with the differences of the planner $(1) and the title $(2).
side_by_side = $(RUN)ehar study overview $(^:/table.md=) --planner $(1) --out runs/$(@F) && \
  $(call page,$@,$(2),ehar study overview $(^:/table.md=) --planner $(1),runs/$(@F))

docs/results/planners.md: $(SETS:%=runs/agents-%-estimator/table.md)
	$(call side_by_side,il-ppo,All planners through the estimator)

docs/results/nbv.md: $(SETS:%=runs/rules-%-estimator/table.md)
	$(call side_by_side,nbv,nbv against the others through the estimator)

docs/results/indoor.md: runs/rules-hdm05-indoor-estimator/table.md runs/rules-sbu-indoor-estimator/table.md
	$(call side_by_side,nbv,A robot indoors)

docs/results/exact-joints.md: $(SETS:%=runs/rules-%-perfect/table.md)
	$(call side_by_side,nbv,Planners with exact joints)

docs/results/flown.md: $(SETS:%=runs/rules-%-drone/table.md)
	$(call side_by_side,nbv,Clips in flight)

docs/results/streams.md: $(foreach track,. -px4-auto. -tracking-drone.,runs/watched-solo-stream$(track:.=)/table.md) \
  runs/aloft-solo-stream-paper/table.md runs/priced-solo-stream/table.md runs/localised/table.md
	$(call page,$@,Streams of one person,ehar benchmark $(WATCHING) --data solo-stream --sensor estimator --models models/solo-stream,$^)

docs/results/couple-streams.md: $(foreach track,. -px4-auto. -tracking-drone.,runs/watched-duo-stream$(track:.=)/table.md) \
  runs/aloft-duo-stream-paper/table.md
	$(call page,$@,Streams of couples,ehar benchmark $(WATCHING) --data duo-stream --sensor estimator --models models/duo-stream,$^)

tracks_among = $(foreach world,$(IN_THE_WAY),$(foreach track,. $(FLYING:%=-%.),runs/$(world)-$(1)$(track:.=)/table.md))
docs/results/obstacle-streams.md: $(call tracks_among,duo-stream) $(SYNTHETIC:%=runs/compared-%/table.md)
	$(call page,$@,Things in the way in streams,ehar benchmark $(AMONG) --data duo-stream --sensor estimator --world room --starts 3,$^)

docs/results/obstacle-flights.md: $(call tracks_among,solo-stream) $(SYNTHETIC:%=runs/there-%/table.md) \
  runs/street/table.md $(FLYING:%=runs/street-%/table.md)
	$(call page,$@,Flying among things in the way,ehar benchmark $(AMONG) --data solo-stream --sensor estimator --world crowd --starts 3,$^)

docs/results/utkinect.md: $(foreach track,. -px4-auto. -tracking-drone.,runs/watched-utkinect$(track:.=)/table.md)
	$(call page,$@,Streams of a real Kinect,ehar benchmark $(WATCHING) --data utkinect.npz --sensor estimator,$^)

# Adults and children: in clips by both forms of the recogniser, and in streams.
PUBLISHED_FORM := $(kindergator) --sensor estimator --form ctrgcn
models/kindergator/ctrgcn-estimator-moving.safetensors: | setup
	$(EHAR) train recogniser $(PUBLISHED_FORM) --out $(@D)

runs/kindergator-ctrgcn/table.md: models/kindergator/ctrgcn-estimator-moving.safetensors
	$(BENCHMARK) no-act $(PUBLISHED_FORM) --models $(<D) --starts $(STARTS) --out $(@D)

docs/results/kindergator.md: runs/rules-kindergator-estimator/table.md runs/kindergator-ctrgcn/table.md \
  $(WORLDS:%=runs/looked-kindergator-stream-%/table.md) runs/looked-kindergator-stream-room-tracking-drone/table.md
	$(call side_by_side,nbv,Adults and children)

docs/results/recorded-streams.md: $(foreach world,$(WORLDS),$(RECORDED:%=runs/looked-%-$(world)/table.md))
	$(call side_by_side,nbv,Looking at recorded people)

docs/results/recorded-flights.md: $(foreach world,$(WORLDS),$(foreach track,$(FLYING),$(FLOWN:%=runs/looked-%-$(world)-$(track)/table.md)) \
  runs/looked-two-$(world)-tracking-drone/table.md) $(foreach world,paper room,$(TAUGHT_ALOFT:%=runs/aloft-%-$(world)/table.md)) \
  runs/there-sbu-stream/table.md
	$(call side_by_side,nbv,Flying around recorded people)

docs/results/glance.md: $(foreach track,. $(FLYING:%=-%.),$(SYNTHETIC:%=runs/watched-%$(track:.=)/table.md)) \
  $(foreach set,$(SYNTHETIC),$(call tracks_among,$(set))) $(foreach world,$(WORLDS),$(RECORDED:%=runs/looked-%-$(world)/table.md)) \
  $(foreach world,$(WORLDS),$(foreach track,$(FLYING),$(FLOWN:%=runs/looked-%-$(world)-$(track)/table.md)) \
  runs/looked-two-$(world)-tracking-drone/table.md)
	$(call side_by_side,nbv,nbv at a glance)

docs/results/stream-trainings.md: $(foreach set,$(SYNTHETIC),$(foreach world,room paper,$(foreach track,. -px4-auto.,runs/seeded-$(set)-$(world)$(track:.=)/table.md)))
	$(call page,$@,Three trainings of streams,ehar study trainings runs/seeded-solo-stream-0-room runs/seeded-solo-stream-1-room,$^)

docs/results/obstacles.md: $(IN_THE_WAY:%=runs/trainings-%/table.md)
	$(call page,$@,Things in the way,ehar benchmark $(RULES) oracle --data solo --sensor estimator --world room,$^)

docs/results/class-maps.md: $(MAPPED:%=runs/class-maps-%/table.md)
	$(call page,$@,Where each class is best seen,ehar study headroom hdm05.npz --azimuths 8 --polars 3,$^)

docs/results/knowledge.md: $(SYNTHETIC:%=runs/knowledge-%/table.md) $(RECORDED:%=runs/knowledge-%/table.md)
	$(call page,$@,What nbv has to know,ehar study ablation --data solo-stream --sensor estimator --groups knowledge,$^)

docs/results/stream-belief.md: $(HEARD:%=runs/belief-%/table.md)
	$(call page,$@,The belief in streams,ehar study belief --data solo-stream --sensor estimator,$^)

docs/results/onsets.md: $(HEARD:%=runs/onset-%/table.md)
	$(call page,$@,What an unknown onset costs,ehar compare runs/known-solo-stream runs/unknown-solo-stream,$^)

docs/results/trainings.md: runs/trainings-duo/table.md runs/trainings-solo/table.md
	$(call page,$@,Three trainings of recogniser and gain field,ehar study trainings runs/rules-duo-estimator \
	  runs/rules-duo-1-estimator runs/rules-duo-2-estimator,$^)

docs/results/learning.md: $(CURVES:%=runs/curve-%/table.md) runs/rules-duo-estimator/table.md runs/rules-hdm05-estimator/table.md
	for set in duo hdm05; do $(RUN)ehar study learning runs/curve-$$set-*/ runs/rules-$$set-estimator --out runs/learning-$$set && \
	  cp runs/learning-$$set/learning.png docs/results/learning-$$set.png || exit 1; done
	$(call page,$@,What is left to win the longer the recogniser learned,ehar study learning runs/curve-duo-*/ \
	  runs/rules-duo-estimator,$(foreach set,duo hdm05,runs/learning-$(set)/table.md))

docs/results/ablation-sbu.md: runs/ablation-sbu/table.md
	$(call page,$@,What each part and setting of nbv is worth on sbu,ehar study ablation $(sbu) --sensor estimator,$^)

docs/results/belief.md: $(SETS:%=runs/belief-%/table.md)
	$(call page,$@,The belief against the recogniser,ehar study belief --data duo --sensor estimator,$^)

docs/results/deciding.md: $(foreach set,hdm05 sbu solo,runs/rules-$(set)-estimator/table.md runs/fitting-$(set)/table.md)
	for set in hdm05 sbu solo; do $(RUN)ehar study decide runs/rules-$$set-estimator --fitted-on runs/fitting-$$set \
	  --planners no-act nbv --out runs/deciding-$$set && \
	  cp runs/deciding-$$set/deciding.png docs/results/deciding-$$set.png || exit 1; done
	$(call page,$@,When to answer,ehar study decide runs/rules-hdm05-estimator --fitted-on runs/fitting-hdm05,\
	  $(foreach set,hdm05 sbu solo,runs/deciding-$(set)/table.md))

DECIDED := $(foreach words,recogniser belief,$(SYNTHETIC:%=$(words)-%)) $(RECORDED)
docs/results/deciding-streams.md: $(DECIDED:%=runs/decided-%/table.md)
	cp runs/decided-recogniser-solo-stream/deciding.png docs/results/deciding-stream.png
	cp runs/decided-belief-solo-stream/deciding.png docs/results/deciding-stream-believed.png
	$(call page,$@,When to answer in streams,ehar study decide runs/answers-recogniser-solo-stream --fitted-on runs/taught-recogniser-solo-stream,$^)

docs/results/headroom.md: $(SETS:%=runs/headroom-%/table.md)
	$(call page,$@,What there is to win,ehar study headroom $(sbu) --sensor estimator --models models/sbu,$^)

docs/results/paper.md: $(PAPER_SETS:%=runs/paper-%/table.md) | $(PAPER_SETS:%=runs/paper-%/analysis/analysis.md)
	$(RUN)ehar study paper $(^:/table.md=) --out runs/$(@F)
	$(call page,$@,The setting and the tables of the paper,ehar study paper $(^:/table.md=),runs/$(@F))

docs/results/published.md: runs/published/table.md
	$(call page,$@,The recogniser against published figures,ehar study published $(DATA)/nwucla.npz --size $(PUBLISHED_SIZE) \
	  --seeds 0 1 2 --out runs/published,$(<D)/table.md)

docs/results/real-views.md: runs/real-views/table.md
	$(call page,$@,What is simulated against real cameras,ehar study real-views $(DATA)/nwucla.npz --out runs/real-views,$(<D)/table.md)

docs/results/trials.md: runs/trials/table.md
	$(call page,$@,What each part of a training is worth,ehar study trials $(TRIAL_SETS) --clips $(TRIAL_CLIPS) --out runs/trials,$(<D)/table.md)

# Without a target: cost (ehar bench), live (ehar live), scaling (ehar study scaling), how streams are stitched (stream-sets),
# and what stood before (mended).
PAGES := planners nbv indoor obstacles exact-joints flown trainings learning ablation-sbu belief deciding deciding-streams glance streams \
  couple-streams obstacle-streams obstacle-flights recorded-streams recorded-flights stream-trainings knowledge stream-belief onsets utkinect \
  headroom class-maps kindergator published real-views trials paper
results: left
	@$(MAKE) --no-print-directory pages

pages: $(PAGES:%=docs/results/%.md)

# What is left of the results: how many commands, and how long they take on this machine, after it has timed a step of a
# training. MACHINES="4 16 64" CORES=16 asks about others.
MACHINES ?= 1
CORES ?= $(shell nproc 2>/dev/null || sysctl -n hw.ncpu)
left: setup
	@$(MAKE) --no-print-directory -n pages | $(RUN)ehar study scaling --commands - --machines $(MACHINES) --cores $(CORES)
	@echo 'make results does it. Without a GPU, or without data in $(DATA): see "Measure again" in docs/contributing.md.'

clean:
	rm -rf $(VENV)
