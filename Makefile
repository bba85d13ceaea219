# make demo: from zero to a verified pool and a contact sheet.   make test: from zero to the passing tests.
PYTHON ?= python3
ENV := .venv
BIN := $(ENV)/bin
READY := $(ENV)/.ready
DEMO := generated/demo

.PHONY: setup demo test wheel slow readme fuzz kills check types format certify axes attacks drift docs site reference bench clean checker checker-base mutants

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] not in [(3, 11), (3, 12)] and "scengen needs Python 3.11 or 3.12; say make PYTHON=...")'
	$(PYTHON) -m venv $(ENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	@sh tools/opengl.sh
	$(BIN)/python -c "from scengen.fingerprint import fingerprint; fingerprint()"  # compiles the control loop
	@touch $(READY)

demo: setup
	$(BIN)/scengen generate task=domino_single n=6 workers=2 pool=$(DEMO)/id
	$(BIN)/scengen generate task=domino_single split=diagonal n=6 workers=2 pool=$(DEMO)/diagonal
	$(BIN)/scengen verify pool=$(DEMO)/id workers=2
	$(BIN)/scengen verify pool=$(DEMO)/diagonal workers=2
	$(BIN)/scengen show pool=$(DEMO)/id,$(DEMO)/diagonal to=$(DEMO)/contact_sheet.html

test: setup
	$(BIN)/scengen verify pool=generated/reference workers=2 expired=report
	$(BIN)/python -m pytest -n 2 --dist loadfile

# The wheel with all its extras, tried away from this folder in an environment of its own, as pip makes it: needs a C
# compiler for the keyboard driver that robosuite asks for.
WHEEL := build/wheel
wheel:
	rm -rf $(WHEEL)
	$(PYTHON) -m venv $(WHEEL)/env
	$(WHEEL)/env/bin/pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir $(WHEEL) .
	$(WHEEL)/env/bin/pip install --quiet --disable-pip-version-check --constraint constraints.txt "$$(ls $(WHEEL)/*.whl)[all]"
	cd $(WHEEL) && sh $(CURDIR)/tools/try_wheel.sh

# Tests that simulate for minutes: coverage of intervals, power.
slow: setup
	$(BIN)/python -m pytest -n 2 --dist loadgroup -m slow

# The commands of the README as they are written, but for the long ones; ALL=all runs those too: hours.
ALL ?=
readme: setup
	$(BIN)/python tests/readme/run.py $(ALL)

# Mangled command lines: each must end with exit 0, 1 or 2 and one line with a remedy. FUZZ of them, from SEED.
FUZZ ?= 2000
SEED ?= 0
fuzz: setup
	$(BIN)/python tests/fuzz/run.py $(FUZZ) $(SEED)

# Generation runs that are killed in every way and continued: their pools must have the same bytes in the end.
KILLS ?= 50
kills: setup
	$(BIN)/python tests/fuzz/kills.py $(KILLS) $(SEED)

check: setup
	$(BIN)/ruff format --check
	$(BIN)/ruff check

types: setup
	$(BIN)/pyright

format: setup
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# Every split of every task at level full: long. N scenarios each; SPLITS=id takes the training splits alone, and
# TASKS=packing some tasks.
N ?= 20
SPLITS ?=
TASKS ?=
certify: setup
	$(BIN)/python tools/certify_all.py $(N) $(TASKS) $(SPLITS)

# The card of every axis of every task, and docs/axes.md: hours. AXES: settings of scengen axis, and tasks to do alone.
AXES ?= n=50
axes: setup
	$(BIN)/python tools/all_axes.py $(AXES)

# The adversary on every task, and docs/attacks.md: some 40 minutes. BUDGET rollouts each; TASKS=packing takes some.
BUDGET ?= 500
attacks: setup
	$(BIN)/python tools/attack_all.py $(BUDGET) $(TASKS)

# Verdicts under other versions of MuJoCo, and docs/drift.md: hours. N scenarios of the pools in POOLS, made where
# there are none; TASKS=packing takes some. The environments come from the package index.
POOLS ?= generated/drift
drift: setup
	$(BIN)/python tools/drift_all.py $(N) $(POOLS) $(TASKS)

# docs/api.md, and a page for each task in docs/tasks, with pictures (needs OpenGL); TASKS=packing writes some alone.
docs: setup
	$(BIN)/python tools/api_page.py
	$(BIN)/python tools/paper_page.py
	$(BIN)/python tools/cluster_page.py
	$(BIN)/python tools/certified_page.py
	$(BIN)/python tools/task_pages.py $(TASKS)

# README, docs, axis cards and reports as plain HTML in SITE.
SITE ?= generated/site
site: setup
	$(BIN)/python tools/site.py $(SITE)

# Verification, and checkers that must do badly, on some 450 pools that are sound, false or hostile: about 15 minutes.
# CHECKER=robosuite lets robosuite judge the sound ones.
CHECKER ?= scengen always parse hashes
checker: setup
	$(BIN)/python tests/checker/run_corpus.py --checker $(CHECKER) --json generated/checker/report.json

# Sound pools with one value changed: what is accepted must be the author's word, or told. MUTANTS of them, from SEED.
MUTANTS ?= 2000
mutants: setup
	$(BIN)/python tests/checker/mutants.py $(MUTANTS) $(SEED)

# The sound pools that the corpus is made from; make them anew when a family changes.
checker-base: setup
	$(BIN)/python tests/checker/make_base.py

# The small pool in the repository; write it anew when a family or the format changes.
reference: setup
	rm -rf generated/reference generated/reference.run
	$(BIN)/scengen generate task=domino_single n=6 workers=2 pool=generated/reference
	rm -rf generated/reference.run

bench: setup
	$(BIN)/scengen bench

clean:
	rm -rf $(ENV) $(DEMO) $(DEMO).run build dist *.egg-info
