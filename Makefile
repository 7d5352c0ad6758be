# Both commands of the README set up all that they need, from a bare Debian with python3 (3.11 or later), venv and make.
.DEFAULT_GOAL := help
VENV := .venv
BIN := $(VENV)/bin
UV := VIRTUAL_ENV=$(VENV) $(BIN)/uv
SCENARIO ?= demo
IMAGE ?= wetwell:latest
BUILDER ?= docker
BASE ?= python:3.11-slim-bookworm
WORKERS := 3
# A file of daemons and pages stays in one process, which makes its site once; of the others idle processes take over.
DIST := loadfile
PYTEST = $(BIN)/pytest -q --numprocesses=$(WORKERS) --dist=$(DIST) --no-loadscope-reorder --durations=10
# One test after the other: a page that is watched must keep up with its site.
BROWSE = $(BIN)/pytest -q --durations=10 tests/browser
# Where every process compiles all modules anew, each start takes three times as long.
export PYTHONDONTWRITEBYTECODE =
# Matrices are small: threads of the linear algebra would only wait for each other, and the tests use all cores.
export OPENBLAS_NUM_THREADS = 1

.PHONY: help up test check page browser others long soak lint types imports kernels modules format docs requirements clean sbom audit release sign verify image

help:  ## Show the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/'

up: $(VENV)/.runtime  ## Run the whole service with a simulated station; Ctrl-C stops
	@exec $(BIN)/wetwell up --scenario $(SCENARIO)

test: WORKERS := 4
test: DIST := worksteal
test: $(VENV)/.dev  ## Lint, types, import contract, and the tests that guard each commit
	@$(MAKE) --no-print-directory --jobs=2 --output-sync kernels types modules lint imports
	$(PYTEST) -m "not check and not long and not soak"

check: sbom  ## The other tests of CI: the browser, chaos, data sets, pages of docs walked through; SBOM
	@$(MAKE) --no-print-directory --jobs=2 --output-sync page others

page: $(VENV)/.dev  ## What of `make check` looks at the page
	$(BROWSE) -m "check and not long and not soak"

browser: $(VENV)/.dev  ## All that looks at the page; after a change of it
	$(BROWSE)

others: $(VENV)/.dev  ## What of `make check` looks at no page; it gives way to the browser
	nice -n 5 $(PYTEST) -m "check and not long and not soak" \
	  $$(grep -rlE 'mark\.check' tests --include='test_*.py' --exclude-dir=browser)

long: $(VENV)/.dev browser  ## What CI has no time for: hundreds of simulated station-days, plants of truth, a fleet, Prometheus, the site of docs
	$(PYTEST) -m "long and not soak" --ignore=tests/browser

soak: $(VENV)/.dev  ## What needs the machine alone: kills at 600 times life; twenty starts, with a load on purpose
	$(BIN)/pytest -q -m soak

lint: $(VENV)/.dev  ## ruff
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(VENV)/.dev  ## mypy
	$(BIN)/mypy

imports: $(VENV)/.dev  ## import contract
	$(BIN)/lint-imports

kernels: $(VENV)/.dev  ## Compile the kernels for the tests, if they or what they call have changed
	$(BIN)/pytest -q -k "test_simulate_then_detect or test_duty_point_of_one_pump" \
	  tests/unit/services/test_cli.py tests/reference/sim2real/test_truth_plant.py

modules: $(VENV)/.dev  ## Compile the modules of the tests once: each process that runs tests would do so
	@mkdir -p build
	@$(BIN)/pytest -qqq --collect-only > build/modules.txt || { cat build/modules.txt; exit 1; }

format: $(VENV)/.dev  ## Bring all files into form
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(VENV)/.dev  ## Build the documentation site in build/site, with its links, and how hard its pages are to read, checked
	$(BIN)/python .ci/readability.py
	@mkdir -p build/mermaid
	@test -d build/mermaid/package || (cd build/mermaid && npm pack --silent mermaid@11 > /dev/null && tar xzf mermaid-*.tgz) || \
	  echo "diagrams will be shown as text: npm or its registry is not there"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

sbom: build/sbom.json  ## Bill of materials of the image, CycloneDX, in build/sbom.json

build/sbom.json: requirements/fleet.txt pyproject.toml $(VENV)/.dev
	@mkdir -p build
	$(BIN)/python -W ignore $(BIN)/cyclonedx-py requirements requirements/fleet.txt --index-url index \
	  --pyproject pyproject.toml --output-reproducible --output-format JSON --output-file $@

audit: $(VENV)/.dev  ## Known holes in the pinned packages, and what scanners say; says so if one is not there
	$(UV) pip check
	$(BIN)/python .ci/audit.py requirements/fleet.txt
	$(BIN)/python .ci/scan.py $(SCANNERS)

release: sbom  ## Wheel, source distribution and bill of materials, in build/release
	rm -rf build/release
	$(BIN)/hatchling build -d build/release
	cp build/sbom.json build/release/

sign: release  ## Sign the release: make sign KEY=release.key IMAGES="--image NAME@sha256:DIGEST"
	$(BIN)/python .ci/provenance.py sign $(KEY) build/release.json build/release/* $(IMAGES)

verify: $(VENV)/.dev  ## Whether a release is what was signed: make verify PUBLIC=release.pem
	$(BIN)/python .ci/provenance.py verify $(PUBLIC) build/release.json build/release/* $(IMAGES)

image:  ## Image of the containers; make image BUILDER="buildah --storage-driver vfs" where there is no Docker
	$(BUILDER) build --build-arg BASE=$(BASE) --file docker/Dockerfile --tag $(IMAGE) .

requirements: $(VENV)/.uv  ## Pin the newest versions anew
	cd requirements && for name in runtime build fleet dev; do \
	  ../$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
	    --no-header --upgrade $$name.in --output-file $$name.txt || exit 1; done

clean:  ## Remove what the targets made
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache build
	find . -name __pycache__ -prune -exec rm -rf {} +

$(VENV)/.uv:
	python3 -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	@touch $@

$(VENV)/.runtime: $(VENV)/.uv requirements/runtime.txt requirements/build.txt pyproject.toml
	$(UV) pip install --quiet --require-hashes -r requirements/runtime.txt -r requirements/build.txt
	$(UV) pip install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.runtime requirements/dev.txt
	$(UV) pip install --quiet --require-hashes -r requirements/dev.txt
	@touch $@
