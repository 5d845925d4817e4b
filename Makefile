# `make demo` and `make test` set up what they need in .venv.
# `make bench` measures side by side with peers; ONLY=stop,line some of it, FULL=1 the long cases, KEEP=1 as reference.
# `make quick` leaves out processes, the app, wide products and slow tests; `make nightly` takes the whole of every product.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Two test processes more than cores: tests that start processes wait for them, and simulated drives work in real time.
WORKERS := $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 2)')
PYTEST = $(BIN)/python -m pytest --dist worksteal -n $(WORKERS)
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo test quick nightly check format lint prose types types-here types-darwin types-win32 contracts measured unmeasured map mutants seams coverage bench readme shipped pictures docs package release fuzz soak simulate snapshots windows clean

demo: $(VENV)/.run
	$(BIN)/multidrop demo

# SINCE=main: what the changes since that commit can break; it says what it leaves out.
test: $(VENV)/.dev
	$(PYTEST) $(if $(SINCE),--since $(SINCE))

# One process a core: nothing here waits, and each collects for seconds.
QUICK := not process and not tui and not wide and not slow
quick: $(VENV)/.dev
	$(BIN)/python -m pytest --dist worksteal -n $(shell $(PYTHON) -c 'import os; print(os.cpu_count() or 1)') -m "$(QUICK)" --hypothesis-profile=quick

nightly: $(VENV)/.dev
	MULTIDROP_KILLS=12 $(PYTEST) --nightly --hypothesis-profile=search
	$(MAKE) seams
	$(MAKE) windows

# The tests for Windows, under Wine, with a CPython for Windows in .venv/windows; TESTS="-x tests/macros": some of them.
windows: $(VENV)/.dev
	$(BIN)/python packaging/windows.py $(TESTS)

# Cheap checks first, side by side: what is wrong is said early. The tests are last, so their summary ends the output.
check: $(VENV)/.dev
	$(MAKE) -j lint prose contracts types
	$(MAKE) seams ONLY=all CHEAP=1
	$(MAKE) measured

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

format: $(VENV)/.dev
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The words to avoid in help, messages and pages, where there are more than accepted. ALL=1: every place; KEEP=1: accept
# the present number, which only falls.
prose: $(VENV)/.dev
	$(BIN)/python -m tests.support.prose $(if $(ALL),--all) $(if $(KEEP),--keep)

types: types-here types-darwin types-win32

types-here: $(VENV)/.dev
	$(BIN)/mypy

types-darwin types-win32: types-%: $(VENV)/.dev
	$(BIN)/mypy --platform $* --cache-dir .mypy_cache/$* --package multidrop

contracts: $(VENV)/.dev
	$(BIN)/lint-imports

# Each test runs once: one that fails on a busy machine is a defect (docs/decisions/0050).
measured: $(VENV)/.dev
	$(PYTEST) --cov --cov-report=

# Measure again which tests coverage leaves out, and which are slow: a quarter of an hour.
unmeasured: $(VENV)/.dev
	-$(PYTEST) --measure-all --cov --cov-report= --cov-context=test --durations=0 > $(VENV)/durations.txt
	$(BIN)/python -m tests.support.choose_measured .coverage $(VENV)/durations.txt
	$(BIN)/python -m tests.support.choose_slow $(VENV)/durations.txt

# Measure again which tests execute which line, for `make mutants`: half an hour. TESTS="tests/drives": of these alone.
map: $(VENV)/.dev
	-COVERAGE_FILE=$(VENV)/map $(PYTEST) --measure-cases --cov --cov-report= --cov-context=test --durations=0 $(TESTS) > $(VENV)/durations.txt
	$(BIN)/python -m pytest --collect-only -q -m "$(QUICK)" $(TESTS) > $(VENV)/quick.txt
	$(BIN)/python -m soak.drawn --measured $(VENV)/map $(VENV)/durations.txt $(VENV)/quick.txt $(if $(TESTS),--some)

# Delete every feature, one at a time and all at once, in copies of the tree, and see that the rest works: modules, front ends
# and quick tests. ONLY="twins all": some; CHEAP=1: without the tests, as `make check` has time for.
seams: $(VENV)/.dev
	$(BIN)/python -m soak.seams $(ONLY) $(if $(CHEAP),--cheap)

# Draw mutants of the product by a seed, and say which of them the tests and the seeds see: ROOM=drives N=100 SEED=7.
mutants: $(VENV)/.dev
	$(BIN)/python -m soak.drawn $(if $(ROOM),--room $(ROOM)) $(if $(N),--count $(N)) $(if $(SEED),--seed $(SEED)) \
	  $(if $(JOBS),--jobs $(JOBS))

coverage: measured
	$(BIN)/coverage report

readme: $(VENV)/.dev
	$(PYTEST) --nightly tests/docs

bench: $(VENV)/.dev
	$(BIN)/python bench/run.py $(if $(ONLY),--only $(ONLY)) $(if $(FULL),--full) $(if $(KEEP),--keep)

# The completions and the man page, from the parser; tests hold that they are up to date.
shipped: $(VENV)/.dev
	$(BIN)/python packaging/generate.py

# The pictures of the README and the docs, taken of the program on the demo cell.
pictures: $(VENV)/.dev
	$(BIN)/python packaging/pictures.py

# The pages as a site in .site, with a search and without a network: `python3 -m http.server -d .site` shows it. mkdocs has
# an environment of its own; zensical 0.1, its successor, needs packages that not every index has.
DOCS := $(VENV)/docs
docs: $(DOCS)/.done
	$(DOCS)/bin/mkdocs build --quiet --strict --config-file packaging/mkdocs.yml

$(DOCS)/.done: packaging/docs-requirements.txt
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check -r $<
	touch $@

# The wheel and the source distribution, in dist.
package: $(VENV)/.dev
	$(BIN)/python -m build --outdir dist .

# Wheel and source distribution with their checks, in dist: one version in all places, a clean tree, and a smoke test in bare
# environments of each Python that is here. Nothing is published.
release: $(VENV)/.dev
	$(BIN)/python packaging/release.py

# Coverage-guided fuzzing of every decoder, parser and simulated port, SECONDS each; atheris has a Python of its own.
SECONDS ?= 20
FUZZ := $(VENV)/fuzz
TARGETS := decode line port modbus_port url configuration cell macro program typed world
fuzz: $(FUZZ)/.done
	mkdir -p .fuzz
	for each in $(TARGETS); do $(FUZZ)/bin/python fuzz/run.py $$each $(SECONDS) .fuzz 2>.fuzz/$$each.log \
	  && grep -h "^Done" .fuzz/$$each.log | sed "s/^/$$each: /" || { tail -30 .fuzz/$$each.log; exit 1; }; done

$(FUZZ)/.done: constraints.txt
	$(PYTHON) -m venv $(FUZZ)
	$(FUZZ)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e . atheris
	touch $@

# Noise, kills and hours of work, judged and reported in soak/results: hours, or minutes with SOAK=short.
soak: $(VENV)/.dev
	SOAK=$(or $(SOAK),full) $(BIN)/python -m soak

# Seeds of the whole program in simulated time: SEED=7 one; SEEDS=1-200 a range on all cores (JOBS=2: on two), which
# RESUME=FILE takes up again, and SUM='FILE FILE' adds up; STEPS=60: longer. ONLY=3,9 WITHOUT=flip,late: what a failure was shrunk to.
# SEEDS=1-2000 MUTANT=NAME (all: each): a planted defect, and the seed that catches it. See CONTRIBUTING.
simulate: $(VENV)/.dev
	$(BIN)/python -m soak.simulation $(if $(SEED),--seed $(SEED)) $(if $(SEEDS),--seeds $(SEEDS)) \
	  $(if $(STEPS),--steps $(STEPS)) $(if $(ONLY),--only $(ONLY)) $(if $(WITHOUT),--without '$(WITHOUT)') \
	  $(if $(JOBS),--jobs $(JOBS)) $(if $(RESUME),--resume $(RESUME)) $(if $(MUTANT),--mutant $(MUTANT)) \
  $(if $(SUM),--sum $(SUM))

snapshots: $(VENV)/.dev
	$(BIN)/python -m pytest tests -k snapshot --snapshot-update

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.run: pyproject.toml constraints.txt | $(VENV)/bin/python
	@echo "installing multidrop into $(VENV), with plots to rerun: 840 MB on disk, one to four minutes"
	$(BIN)/python -m pip install --disable-pip-version-check --progress-bar on -c constraints.txt -e '.[rerun]'
	touch $@

$(VENV)/.dev: pyproject.toml constraints.txt requirements-dev.txt | $(VENV)/bin/python
	$(PIP) -c constraints.txt -e '.[rerun,lsp,mqtt,opcua,prometheus,usb,cluster,fit]' -r requirements-dev.txt
	touch $@ $(VENV)/.run

clean:
	rm -rf $(VENV) .site .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage
