# What people run. Everything it needs is installed by deploy/install-tools.sh, which says what it installs.

# One build outside the checkout serves every clone, `make demo` and `make test` alike.
export CARGO_TARGET_DIR ?= $(HOME)/.cache/fluxglobe/target
export FLUXGLOBE_TOOLS ?= $(HOME)/.cache/fluxglobe/tools
export CMAKE ?= $(FLUXGLOBE_TOOLS)/bin/cmake
export PIP ?= $(FLUXGLOBE_TOOLS)/bin/pip
# What is built once from nothing and then run gains nothing by being split for the next edit.
export CARGO_INCREMENTAL ?= 0
# Mesa's device chooser would look for a desktop session and complain on servers, which have none.
export NODEVICE_SELECT := 1

fluxglobe := $(CARGO_TARGET_DIR)/debug/fluxglobe
# The checkout that was built last.
built_from := $(CARGO_TARGET_DIR)/built-from
# Tests that ended without having run say so in here.
not_run := $(CARGO_TARGET_DIR)/tests-not-run
viewer := tile-server/web/dist/index.html
viewer_sources := $(shell git ls-files tile-server/web)

.DEFAULT_GOAL := help
.PHONY: help checkout demo build release viewer check test faults bench bless gallery describe services services-down cluster cluster-down tools test-tools gallery-tools

help: ## Show this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 14

demo: build ## Ingest real data, compute budgets, serve the globe on http://localhost:8080 (ARGS="..." are passed on)
	$(fluxglobe) demo $(ARGS)

# Cargo goes by times: files of one checkout that are older than what another one built would pass for built.
checkout:
	@mkdir -p $(CARGO_TARGET_DIR)
	@[ "$$(cat $(built_from) 2>/dev/null)" = "$(CURDIR)" ] || git ls-files -z '*.rs' | xargs -0 -r touch
	@echo "$(CURDIR)" >$(built_from)

build: checkout tools viewer ## Build the program and the viewer
	cargo build --locked -p fluxglobe

release: checkout tools viewer ## Build the program as deployments run it: optimised, under target/release
	cargo build --locked --release -p fluxglobe
	@echo 'install as root: install -m 755 $(CARGO_TARGET_DIR)/release/fluxglobe /usr/local/bin/'

services: ## Install and start Kafka, PostGIS, S3, HDFS and Prometheus, each in its own folder and on its own port
	deploy/services/services.sh install
	deploy/services/services.sh start
	@echo 'settings that reach them: eval "$$(deploy/services/services.sh env)"'

services-down: ## Stop them; data stay
	deploy/services/services.sh stop

cluster: build ## Start the servers and every service as a process, with sample data flowing
	FLUXGLOBE_PROGRAM=$(fluxglobe) deploy/cluster.sh up

cluster-down: ## Stop the services and the servers; data stay
	deploy/cluster.sh down

viewer: $(viewer)

$(viewer): $(viewer_sources) | tools
	@deploy/check-node.sh
	# Not `npm ci`: it fails without other platforms' optional packages, which a partial mirror lacks. The lock file holds.
	cd tile-server/web && npm install --no-save --no-audit --no-fund && npm run build

tools:
	@deploy/install-tools.sh run

test-tools:
	@deploy/install-tools.sh test

gallery-tools:
	@deploy/install-tools.sh gallery

check: checkout tools ## The quick part of the tests: format, lints, types, spelling
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings

test: checkout test-tools $(viewer) ## Everything that CI runs
	cargo fmt --all --check
	$(FLUXGLOBE_TOOLS)/bin/typos
	cd tile-server/web && npm run check && npm test
	tests/run.py --build
	deploy/services/services.sh install
	rm -f $(not_run)
	fluxengine=$$(tests/data/fetch.sh) && FLUXGLOBE_FLUXENGINE=$$fluxengine FLUXGLOBE_SKIPPED=$(not_run) \
		deploy/with-services.sh tests/run.py
	tests/data/report.sh $(not_run)
	deploy/check.sh

faults: checkout test-tools $(viewer) ## kill -9 of every kind of process, 60 times, while granules land and tiles are drawn
	cargo build --locked --workspace --lib --bins --tests
	deploy/services/services.sh install
	FLUXGLOBE_KILLS=60 cargo test --locked -p tests --test cluster killed -- --nocapture

bench: build ## Measure beside peers (ARGS=tiles: titiler-xarray; ARGS=stats: xarray and dask, 16 years; more options after the name)
	deploy/install-tools.sh bench
	$(FLUXGLOBE_TOOLS)/peers/bin/python -B tests/bench/$(firstword $(ARGS) tiles).py --program $(fluxglobe) $(wordlist 2,99,$(ARGS))

bless: test-tools ## Draw the golden images anew, for a new RENDERER_VERSION, and list what changed
	BLESS=1 cargo test --locked -p render --test it golden
	git status --short -- render/tests/golden

gallery: build gallery-tools ## Draw the pictures of docs/gallery.md that are missing or changed (ARGS=--all everything, ARGS=NAME one)
	FLUXGLOBE_PROGRAM=$(fluxglobe) $(FLUXGLOBE_TOOLS)/bin/python -B gallery/make.py $(ARGS)

describe: test-tools $(viewer) ## Write tile-server/openapi.json and the viewer's types anew, after a change of the HTTP API
	BLESS=1 cargo test --locked -p tile-server --test it openapi
	cd tile-server/web && npm run generate
	git status --short -- tile-server/openapi.json tile-server/web/src/api/schema.ts
