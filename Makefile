# make demo: certify and verify the two pools of the README.   make test: run the tests.   make ci: everything that CI runs.
PYTHON ?= python3
ENV := .venv
BIN := $(ENV)/bin
READY := $(ENV)/.ready
DEMO := generated

.PHONY: setup demo ci test wheel stored slow durations readme fuzz kills check types format certify stacks stack-sample warp readers integrations figures axes beliefs attacks drift baselines curves docs docs-links results pictures site reference bench clean checker checker-base mutants behaviour behaviour-check tag

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(ENV)
	@sh tools/setup.sh python $(BIN)/python
	@sh tools/setup.sh opengl
	$(BIN)/python -c "from scengen.work.fingerprint import fingerprint; fingerprint()"  # compiles the control loop
	@touch $(READY)

demo: setup
	$(BIN)/scengen generate task=domino_single n=10 workers=2 pool=$(DEMO)/id
	$(BIN)/scengen generate task=domino_single split=low_starter n=10 workers=2 pool=$(DEMO)/low_starter
	$(BIN)/scengen verify pool=$(DEMO)/id workers=2
	$(BIN)/scengen verify pool=$(DEMO)/low_starter workers=2
	$(BIN)/scengen show pool=$(DEMO)/id,$(DEMO)/low_starter to=$(DEMO)/contact_sheet.html films=true
	@echo "20 scenarios are certified and verified: open $(DEMO)/contact_sheet.html in a browser, then see README.md, Generate, verify, look"

# What continuous integration runs. The certified sample is two of the paper's OOD conditions; the stored behaviour has all tasks.
# What runs on one core runs two at a time.
ci:
	@sh tools/setup.sh chromium
	$(MAKE) check
	$(MAKE) test
	$(MAKE) stored
	$(MAKE) --jobs=2 --output-sync=target types readme wheel stack-sample docs
	$(MAKE) certify N=1 TASKS="domino_single tool_retrieve" SPLITS="diagonal mirrored_hook"

test: setup
	$(BIN)/scengen verify pool=generated/reference sample=1 workers=2
	$(BIN)/python -m pytest -n 2 --dist loadfile

# Builds the wheel, installs it with all extras into an environment of its own, and tries it outside this folder. Needs a C
# compiler for the keyboard driver on which robosuite depends.
WHEEL := build/wheel
wheel:
	rm -rf $(WHEEL)
	$(PYTHON) -m venv $(WHEEL)/env
	$(WHEEL)/env/bin/pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir $(WHEEL) .
	$(WHEEL)/env/bin/pip install --quiet --disable-pip-version-check --constraint constraints.txt "$$(ls $(WHEEL)/*.whl)[all]"
	cd $(WHEEL) && sh $(CURDIR)/tools/setup.sh wheel

# Longer tests that each change must pass: the stored behaviour of every task, examples, pages, browsers (8 minutes).
stored: setup
	$(BIN)/python -m pytest -n 3 --dist loadgroup -m each_change

# Tests that take a second or more, such as one certificate per task and the corpus of false pools (an hour). Run them before a release.
slow: setup
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m slow

# Measures the processor time of every test, and writes tests/durations.txt, by which tests are slow (an hour).
durations: setup
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m "" --durations-file

# Runs the commands of the README and of the pages in docs/ as they are written, except long ones; ALL=all runs those too (hours).
ALL ?=
readme: setup
	$(BIN)/python tests/readme/run.py $(ALL)

# Runs FUZZ mangled command lines, from SEED. Each must exit with status 0 to 3, and with 2 it must print one line with a remedy.
FUZZ ?= 2000
SEED ?= 0
fuzz: setup
	$(BIN)/python tests/fuzz/run.py $(FUZZ) $(SEED)

# Kills and repeats KILLS runs of scengen generate, or of the kinds in RUNS, such as "demos record" or all, which includes the studio
# while a person judges. They must have the same bytes at the end.
KILLS ?= 50
RUNS ?= generate
kills: setup
	$(BIN)/python tests/fuzz/kills.py $(KILLS) $(SEED) $(RUNS)

check: setup
	$(BIN)/ruff format --check
	$(BIN)/ruff check

types: setup
	$(BIN)/pyright

format: setup
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# Measurements below are commands of scengen that fill records/: scengen help measure explains them. An interrupted one is continued.
# TASKS="packing edge_slide" selects tasks, WORKERS=4 the number of processes.
TASKS ?=
SPLITS ?=
WORKERS ?= 2
empty :=
comma := ,
list = $(subst $(empty) $(empty),$(comma),$(strip $(1)))
of_tasks = $(if $(TASKS),task=$(call list,$(TASKS)))
MEASURE = $(BIN)/scengen measure workers=$(WORKERS) $(of_tasks)

# Certifies N scenarios of every split of every task at level full (hours), into a ledger of this commit, which continues it; code that
# is not committed is certified anew. SPLITS=id selects splits.
N ?= 20
certify: setup
	$(MEASURE) kind=certified level=full n=$(N) draws=0 replays=0 $(if $(SPLITS),splits=[$(call list,$(SPLITS))]) \
		records=generated/certify/$$(git rev-parse HEAD) fresh=$$(git diff --quiet HEAD && echo false || echo true)

# Measures certification, sub-goals and questions, as the documentation shows them, and plays the cheats of people (hours).
figures: setup
	$(MEASURE) kind=certified
	$(MEASURE) kind=plan
	$(MEASURE) kind=prior
	$(BIN)/python tests/attack/recall.py play $(TASKS)
	$(BIN)/python tools/build_docs.py results

# Runs the quick tests and certifies one scenario of each task under other versions of Python, MuJoCo and numpy (hours).
# STACKS=mujoco4-python3.13 selects stacks.
STACKS ?=
stacks: setup
	$(BIN)/python tools/stacks.py all $(STACKS)

# A sample on MuJoCo 4 with numpy 2 and the Python of make setup (3 minutes).
stack-sample: setup
	$(BIN)/python tools/stacks.py sample

# Exports certified scenarios as worlds, plays their witnesses by joint targets in mujoco_warp on the processor, and stores how often goal
# and end agree with C MuJoCo (4 minutes for each task). TASKS="packing edge_slide" selects tasks.
warp: setup
	$(BIN)/python tools/warp_worlds.py $(TASKS)

# Opens recordings of every embodiment with LeRobot, robomimic, lerobot-doctor and lerobot-lint in environments of their own, which come
# from the package index (Python 3.12, gigabytes), and writes docs/readers.md.
readers: setup
	$(BIN)/python tools/check_readers.py

# Plays the packages of integrations/ in LeRobot, robomimic, vla-eval and inspect-robots, in environments of their own, and compares verdicts
# or actions. INTEGRATIONS=vla_eval_scengen selects packages. LeRobot needs Python 3.12 and gigabytes.
INTEGRATIONS ?=
integrations: setup
	$(BIN)/python tools/stacks.py integrations $(INTEGRATIONS)

# Makes the card of every axis with TWINS twins (hours).
TWINS ?= 50
axes: setup
	$(MEASURE) kind=axis n=$(TWINS)
	$(BIN)/python tools/build_docs.py results

# Plays planners with beliefs of training on 8 twins of every axis without a record (an hour).
beliefs: setup
	$(MEASURE) kind=belief
	$(BIN)/python tools/build_docs.py results

# Searches observations for hidden parameters, and attacks every task with BUDGET rollouts (an hour).
BUDGET ?= 500
attacks: setup
	$(MEASURE) kind=leak
	$(MEASURE) kind=attack budget=$(BUDGET)
	$(BIN)/python tools/build_docs.py results

# Compares verdicts under several VERSIONS of MuJoCo (hours). Missing pools are made in generated/drift. The environments come from the
# package index.
VERSIONS ?= 3.5.0,4.0.0
drift: setup
	$(MEASURE) kind=drift mujoco=[$(VERSIONS)]

# Trains and evaluates small policies (about half an hour of processor time for each task). curves trains with three seeds on 25 to 100
# demonstrations (half an hour for each task), on other styles, and on spoiled, curated and random ones (a quarter of an hour for each
# task), and with the wrench.
BASELINES := domino_single mirror_pick_place linear_intercept pendulum_grasp edge_slide tool_retrieve pick_place_ycb slip_recovery \
	balance_medium cube_toss domino_select bounce_intercept
baselines: TASKS := $(or $(TASKS),$(BASELINES))
baselines: setup
	$(MEASURE) kind=baseline
	$(BIN)/python tools/build_docs.py results

curves: setup
	$(BIN)/scengen measure kind=training workers=$(WORKERS) task=$(call list,$(or $(TASKS),$(BASELINES))) compare=curves
	$(BIN)/scengen measure kind=training workers=$(WORKERS) task=$(call list,$(or $(TASKS),tool_retrieve edge_slide balance_medium)) compare=styles
	$(BIN)/scengen measure kind=training workers=$(WORKERS) task=$(call list,$(or $(TASKS),tool_retrieve edge_slide balance_medium)) compare=curation
	$(BIN)/scengen measure kind=training workers=$(WORKERS) task=mass_sort compare=wrench

# Builds the documentation into build/docs/html: the pages of docs/, and those that are generated from the code and the ledger. A warning,
# such as a link that leads nowhere, is an error. FILMS=1 adds films in three dimensions to the pages of tasks (half an hour of processor time
# for all; TASKS=packing makes some). Films that are up to date are kept. docs-links also tries the links to other hosts.
FILMS ?=
docs: setup
	$(if $(FILMS),$(BIN)/scengen site to=build/docs/extra/films $(of_tasks))
	$(BIN)/python tools/build_docs.py

docs-links: setup
	$(BIN)/python tools/build_docs.py linkcheck

# Writes docs/results.md, the headline figures, from the ledger.
results: setup
	$(BIN)/python tools/build_docs.py results

# Writes the pictures of docs/tasks and docs/scenes.webp (needs OpenGL). TASKS=packing selects tasks.
pictures: setup
	$(BIN)/python tools/pictures.py strips $(TASKS)

# Writes the films alone, as a web site of tasks, into SITE. TASKS=packing makes some tasks. An interrupted call is continued.
SITE ?= generated/site
site: setup
	$(BIN)/scengen site to=$(SITE) $(of_tasks)

# Runs verification, and control checkers that must fail, on about 450 sound, false and hostile pools (15 minutes).
# CHECKER=robosuite replays the sound ones in robosuite.
CHECKER ?= scengen always parse hashes
checker: setup
	$(BIN)/python tests/checker/run_corpus.py --checker $(CHECKER) --json generated/checker/report.json

# Verifies MUTANTS sound pools with one changed value, from SEED. An accepted change must be the author's word, or reported.
MUTANTS ?= 2000
mutants: setup
	$(BIN)/python tests/checker/mutants.py $(MUTANTS) $(SEED)

# Makes the sound pools of the corpus again; needed when a family changes.
checker-base: setup
	$(BIN)/python tests/checker/make_base.py

# Stores the behaviour of tasks whose bits or version have changed (a minute for each). TASKS=packing selects tasks. behaviour-check
# plays all that is stored for tasks whose code has changed since the last time (a minute for each).
behaviour: setup
	$(BIN)/python tools/behaviour.py write $(TASKS)

behaviour-check: setup
	$(BIN)/python tools/behaviour.py check changed $(TASKS)

# Makes the pools that come with scengen again, three scenarios of each task, six of the one that tests use most (half an hour; TASKS=packing
# makes some); needed when a family or the format changes.
reference: setup
	for task in $(or $(TASKS),$$($(BIN)/python -c "import scengen; print(*scengen.list_tasks())")); do \
		rm -rf generated/reference/$$task-id; \
		$(BIN)/scengen generate task=$$task n=$$(test $$task = domino_single && echo 6 || echo 3) workers=$(WORKERS) \
			pool=generated/reference/$$task-id || exit 1; \
		rm -rf generated/reference/$$task-id.run; done
	$(BIN)/python -c "from pathlib import Path; from scengen import Pool; from scengen.pool.collection import write_index as w; \
		f = Path('generated/reference'); w(f, [Pool.open(each) for each in sorted(f.glob('*-id'))])"

bench: setup
	$(BIN)/scengen bench

# Tags the commit as the release that pyproject.toml names. CHANGELOG.md must have a dated section for it, and nothing may be uncommitted.
tag:
	@version=$$(sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml); \
	test -z "$$(git status --porcelain)" || { echo "commit or remove what is uncommitted"; exit 1; }; \
	grep -q "^version: $$version$$" CITATION.cff || { echo "CITATION.cff has another version than $$version"; exit 1; }; \
	grep -Eq "^## $$version - [0-9]{4}-[0-9]{2}-[0-9]{2}$$" CHANGELOG.md || { echo "CHANGELOG.md has no dated section $$version"; exit 1; }; \
	git tag --annotate "v$$version" --message "scengen $$version" && echo "tagged v$$version; publish it with git push origin v$$version"

clean:
	rm -rf $(ENV) build dist *.egg-info
