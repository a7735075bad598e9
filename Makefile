# gestured: `make help` says what there is.
#
# Two environments: .venv holds the runtime alone (what a vehicle gets), .venv-dev what tests and training need.
# A stamp in each says that it is complete, so that the second run asks pip for nothing and works offline.

.PHONY: help demo bridges test golden lint bench figures lab hostile fuzz soak install uninstall system-test \
	dist deb release package-test lock site clean
.NOTPARALLEL:
.DEFAULT_GOAL := help
MAKEFLAGS += --no-builtin-rules
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV
export PIP_DISABLE_PIP_VERSION_CHECK = 1
export PIP_NO_INPUT = 1

SECONDS = 60
MODEL = cnn_lstm
PYTHON =
ARGS =
ARCH =
DESTDIR =
PREFIX = /usr
# The same version everywhere; the extra index has the build without CUDA, which is a tenth of the size.
TORCH = torch==2.13.0
TORCH_INDEX = https://download.pytorch.org/whl/cpu

help:  ## this list
	@echo "usage: make TARGET [NAME=VALUE ...]"
	@sed -n 's/^\([a-z-]*\):.*## /  \1\t/p' Makefile | expand -t 10

# At a terminal the demo is a job of its own, so that Ctrl-C is for it and not for make. It shows what is edited here, also
# where `pip install .` has left a copy of gestured in the environment.
demo: .venv/.runtime  ## recognise simulated gestures with the real daemon: SECONDS=20 MODEL=lstm SPEED=fast ARGS="--seed 7"
	@[ ! -t 0 ] || set -m; PYTHONPATH="$(CURDIR)" .venv/bin/gesturectl demo --seconds "$(SECONDS)" --model "$(MODEL)" $(if $(SPEED),--speed "$(SPEED)") $(ARGS)

bridges: .venv/.bridges  ## what gestured-bridge needs for MQTT, Zenoh and serial sensors, into .venv
	@.venv/bin/gestured-bridge --help

# One process more than there are cores, since tests wait for programs that they have started.
test: .venv-dev/.dev  ## run the tests: ARGS="tests/core -k tap"
	@$(MAKE) -s --no-print-directory .venv-dev/.lab || echo "note: without the lab's packages its tests are skipped" >&2
ifdef ARGS
	@.venv-dev/bin/python -m pytest $(ARGS)
else
	@.venv-dev/bin/python -m pytest --numprocesses $$(($$(getconf _NPROCESSORS_ONLN) + 1)) --dist loadfile
endif

golden: .venv-dev/.dev  ## play all golden tapes: the same packets give the same events (tests/golden)
	@.venv-dev/bin/python -m pytest tests/golden -m "hostile or not hostile" $(ARGS)

lint: .venv-dev/.dev .venv-dev/.lab  ## ruff and mypy
	@.venv-dev/bin/ruff check .
	@.venv-dev/bin/ruff format --check .
	@.venv-dev/bin/mypy

bench: .venv-dev/.dev .venv-dev/.lab  ## speed as ratios measured side by side, some minutes: ARGS="--only decode start"
	@.venv-dev/bin/python -m benchmarks $(ARGS)

figures: .venv-dev/.dev .venv-dev/.lab  ## the documents' tables made again, some hours: ARGS=--stale lists what is old
	@.venv-dev/bin/python -m experiments.figures $(ARGS)

lab: .venv-dev/.dev .venv-dev/.lab  ## what training needs (torch), and how to train
	@.venv-dev/bin/gestured-lab --help

hostile: .venv-dev/.dev .venv-dev/.lab  ## the slow fault tests, twelve hours of everyday contact, what damage does, a minute of each fuzzer
	@.venv-dev/bin/python -m pytest -m hostile $(ARGS)
	@.venv-dev/bin/python -m experiments.damage
	@.venv-dev/bin/python -m experiments.deaf
	@$(MAKE) -s --no-print-directory fuzz

fuzz: .venv-dev/.fuzz  ## fuzz the parsers and the model loader, each for: SECONDS=60
	@for target in decoder request model; do \
		.venv-dev/bin/python -m tests.fuzz.run $$target --seconds "$(SECONDS)" || exit 1; done

soak: .venv-dev/.dev  ## a day compressed, then ten minutes of 20 sensors in real time
	@.venv-dev/bin/python -m experiments.soak --compressed
	@.venv-dev/bin/python -m experiments.soak

install: PYTHON := $(or $(PYTHON),/usr/bin/python3)
install:  ## into DESTDIR, below PREFIX=/usr, for PYTHON=/usr/bin/python3: programs, units, pages
	@rm -rf build/install && mkdir -p build  # the interpreter may be another one than the last time
	$(call venv,build/install)
	@deploy/install.sh build/install "$(DESTDIR)" "$(PREFIX)"

uninstall:  ## remove what `make install` has put there; settings and account stay
	@deploy/uninstall.sh "$(DESTDIR)" "$(PREFIX)"

system-test: .venv-dev/.dev  ## install, boot a real systemd (root, systemd-nspawn), and treat the daemon badly
	@.venv-dev/bin/python -m pytest -rs -s tests/systemd/fleet.py tests/systemd/system.py

dist: build/tools/.tools  ## the wheel and the sdist into dist/, built twice and compared
	@build/tools/bin/python -m deploy.release build dist
	@build/tools/bin/twine check --strict dist/gestured-*

deb: PYTHON := $(or $(PYTHON),/usr/bin/python3)
deb:  ## a Debian package for this Debian or Ubuntu into dist/: ARCH=arm64 puts one together for another machine
	@rm -rf build/deb && mkdir -p build
	$(call venv,build/deb)
	@deploy/deb.sh build/deb dist "$(ARCH)"

release: build/tools/.tools  ## what a tagged commit publishes into an empty dist/: wheel, sdist, .deb, SHA256SUMS
	@build/tools/bin/python -m deploy.release ready
	@rm -rf dist
	@$(MAKE) -s --no-print-directory dist
	@$(MAKE) -s --no-print-directory deb
	@build/tools/bin/python -m deploy.release sums dist
	@echo "next: git push --tags; build/tools/bin/twine upload dist/gestured-*; publish the .deb and SHA256SUMS beside them"

package-test: .venv-dev/.dev build/tools/.tools  ## the wheel and the .deb as a stranger uses them (root, mmdebstrap, systemd-nspawn)
	@.venv-dev/bin/python -m pytest -rs -s tests/systemd/package.py $(ARGS)

lock: build/tools/.tools  ## the newest versions of what a package brings and is built with, with hashes, into deploy/locks
	@echo 'build hatchling>=1.27 shtab>=1.9' | tr ' ' '\n' | $(LOCK) - --output-file deploy/locks/build.txt
	@$(LOCK) pyproject.toml --extra mqtt --extra zenoh --extra serial --output-file deploy/locks/runtime.txt

site: .venv-dev/.dev  ## the documents as a searchable site in build/site/html
	@deploy/site/build.sh .venv-dev/bin/python build/site

ros: .venv-dev/.dev .venv-ros/.ros  ## test deploy/ros2 with a real ROS 2 from PyPI, which it installs into .venv-ros (x86_64)
	@.venv-dev/bin/python -m pytest -rs tests/deploy/test_ros.py $(ARGS)

clean:  ## remove the environments and what tools left behind
	rm -rf .venv .venv-dev .venv-ros build dist .pytest_cache .hypothesis .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# $(call venv,DIR): make the environment, or say in one sentence what is missing.
define venv
@py=; for p in $(or $(PYTHON),python3 python3.14 python3.13 python3.12 python3.11); do \
	"$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && py=$$p && break; \
done; \
[ -n "$$py" ] || { echo "gestured needs Python 3.11 or newer, and \
$(if $(PYTHON),$(PYTHON) is none,there is none here: sudo apt install python3 python3-venv)" >&2; exit 1; }; \
"$$py" -c 'import venv, ensurepip' 2>/dev/null || { echo "$$py has no venv module: sudo apt install" \
	"$$("$$py" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')" >&2; exit 1; }; \
[ -x $(1)/bin/pip ] && $(1)/bin/python -c '' 2>/dev/null || "$$py" -m venv --clear $(1) || { \
	echo "no virtual environment could be made in $(CURDIR)/$(1); python's own words are above" >&2; exit 1; }; \
echo '*' >$(1)/.gitignore
endef

# $(call install,DIR,WHAT,PIP'S ARGUMENTS): silent when it works, one sentence when it does not.
define install
@echo "installing $(2) into $(1) (the first time only)"
@$(1)/bin/pip install $(3) >$(1)/pip.log 2>&1 </dev/null || { \
	if grep -qiE 'name resolution|NewConnectionError|Connection refused|unreachable|ProxyError|timed out' $(1)/pip.log; \
	then echo "no package index can be reached: connect this machine, or set PIP_INDEX_URL to an index that it reaches" >&2; \
	else echo "pip could not install $(2): $$(grep -i error $(1)/pip.log | tail -n 1) (all of it: $(1)/pip.log)" >&2; fi; \
	exit 1; }
endef

.venv/.runtime: pyproject.toml
	$(call venv,.venv)
	$(call install,.venv,the runtime,-e .)
	@touch $@

.venv/.bridges: .venv/.runtime
	$(call install,.venv,the bridges,-e '.[mqtt$(,)zenoh$(,)serial]')
	@touch $@

.venv-dev/.dev: pyproject.toml
	$(call venv,.venv-dev)
	$(call install,.venv-dev,the test tools,-e '.[dev]')
	@touch $@

LOCK = build/tools/bin/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
	--custom-compile-command "make lock"

# What builds is pinned, as a wheel says what built it; what only looks at it is not.
build/tools/.tools: deploy/locks/build.txt
	@mkdir -p build
	$(call venv,build/tools)
	$(call install,build/tools,what builds packages,--require-hashes -r deploy/locks/build.txt)
	$(call install,build/tools,what tries packages,pipx twine uv)
	@touch $@

.venv-dev/.lab: .venv-dev/.dev
	$(call install,.venv-dev,$(TORCH),--no-deps --retries 0 --extra-index-url $(TORCH_INDEX) $(TORCH))
	$(call install,.venv-dev,the lab,-e '.[dev$(,)lab]')
	@touch $@

# The CMake files of PyPI's ROS 2 name the Python of the machine that built them.
.venv-ros/.ros: pyproject.toml tests/deploy/ros/requirements.txt
	$(call venv,.venv-ros)
	$(call install,.venv-ros,ROS 2,-e . -r tests/deploy/ros/requirements.txt)
	@grep -rl --include=*.cmake /opt/python/cp .venv-ros/share | xargs -r sed -i \
		"s|/opt/python/cp[0-9]*-cp[0-9]*|$$(.venv-ros/bin/python -c 'import sys; print(sys.base_prefix)')|g"
	@touch $@

.venv-dev/.fuzz: .venv-dev/.dev
	$(call install,.venv-dev,the fuzzer,-e '.[dev$(,)fuzz]')
	@touch $@

, := ,
