# Needs Python 3.10 to 3.13 and make; everything else goes into .venv.
.DEFAULT_GOAL := help
.PHONY: help front peers worn soak style test test-slow test-machines test-colcon fuzz fuzz-messages bench demo docs mannequin lint clean
SHELL := /bin/bash

# The first Python that is young enough and old enough.
SYSTEM_PYTHON = $(shell for p in $(PYTHON) python3 python3.13 python3.12 python3.11 python3.10; do \
	$$p -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 14))' 2>/dev/null && echo $$p && break; done)
PY := .venv/bin/python
STAMP := .venv/.installed
# So many processes as test/conftest.py says.
SPREAD := --numprocesses auto --dist loadfile

help: ## This list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' Makefile | expand -t 14

# With ROS on the machine its rclpy is used, seen through the environment; without, the real one
# from the package index is installed.
$(STAMP): setup.py
	@test -n "$(SYSTEM_PYTHON)" || { echo "error: python3: none from 3.10 to 3.13 found" >&2; exit 2; }
	@set -e; \
	if $(SYSTEM_PYTHON) -c 'import rclpy' 2>/dev/null; then extras=dev; flags=--system-site-packages; \
	else extras=ros,dev; flags=; fi; \
	test -x $(PY) || $(SYSTEM_PYTHON) -m venv $$flags .venv || { rm -rf .venv; \
		echo "error: $(SYSTEM_PYTHON) -m venv: failed; where ensurepip is missing: apt install python3-venv" >&2; exit 2; }; \
	$(PY) -m pip --version >/dev/null || { echo "error: .venv: has no pip; allowed: remove it" >&2; exit 2; }; \
	echo "installing into .venv (once, some minutes)"; \
	$(PY) -m pip install --quiet --disable-pip-version-check --editable ".[$$extras]"
	@touch $@

# Types are checked beside the tests: they take one core, and nodes often wait for each other.
test: style ## Format, lint, types, layers and the tests under a minute each
	@mkdir -p out; $(PY) -m mypy >out/types.txt 2>&1 & types=$$!; \
	echo "$(PY) -m pytest $(SPREAD)"; $(PY) -m pytest $(SPREAD); tests=$$?; \
	wait $$types; types=$$?; cat out/types.txt; exit $$((tests ? tests : types))

style: $(STAMP)
	$(PY) -m ruff format --check .
	$(PY) -m ruff check .

lint: style
	$(PY) -m mypy

test-slow: $(STAMP) ## The tests that take longer
	$(PY) -m pytest -m slow

test-machines: $(STAMP) ## The tests as other processors, Pythons and the oldest versions run them
	$(PY) test/machines.py $(ARGS)

test-colcon: $(STAMP) ## `colcon build` and `ros2 run` paths, in a temporary environment
	$(PY) -m pytest -m slow test/unit/test_package_install.py

fuzz: $(STAMP) ## Thousands of damaged files of every format; those that a reader falls over in out/fuzz
	cd test && PYTHONPATH=.:.. ../$(PY) -m hostile.run --mutants 5000 --keep ../out/fuzz $(ARGS) >/dev/null

fuzz-messages: $(STAMP) ## A million damaged messages to the nodes' handlers: how many, and what failed (ARGS=--count N)
	cd test && PYTHONPATH=.:.. ../$(PY) -W ignore -m hostile.messages --count 1000000 $(ARGS) >/dev/null

soak: $(STAMP) ## Nodes killed, disk full, flood, clock set, hours of clips: a table (minutes; ARGS=--full: hours)
	cd test && PYTHONPATH=.:.. ../$(PY) -m soak.run $(ARGS)

bench: $(STAMP) ## Timing figures, as ratios within one run
	@set -e; for file in bench/*.py; do echo "== $$file"; $(PY) $$file; done

front: $(STAMP) ## Whether speed and accuracy are where they were: fails where they are worse (a minute)
	$(PY) bench/front.py $(ARGS)

peers: $(STAMP) ## Other cloth simulators, in environments of their own, and ours in the same scenes (long; ARGS=--write: docs)
	$(PY) bench/peers/compare.py $(ARGS)

worn: $(STAMP) ## Whether garments stay worn, on the shared bodies and clips (long)
	$(PY) bench/worn.py $(ARGS)

demo: $(STAMP) ## A dressed, walking avatar over real ROS 2; pictures and figures in out/demo
	$(PY) -m garment_sim_ros.cli.main demo --out out/demo $(ARGS)

# Without compilation kernels are functions, with a signature and a docstring.
MODULES = garment_sim_ros $(subst /,.,$(patsubst %/__init__.py,%,$(wildcard garment_sim_ros/*/__init__.py)) \
	$(patsubst %.py,%,$(filter-out %/__init__.py,$(wildcard garment_sim_ros/*.py))))
docs: $(STAMP) ## Reference of all functions, from their docstrings, in out/docs
	NUMBA_DISABLE_JIT=1 $(PY) -W error::UserWarning -m pdoc --docformat google --output-directory out/docs $(MODULES)

mannequin: $(STAMP) ## The default mannequin and its hulls anew, after a change to how they are made
	$(PY) -c "import numpy; from garment_sim_ros.body.mannequin.mannequin import MannequinOptions, grown; \
	numpy.savez_compressed('garment_sim_ros/body/mannequin/mannequin_default.npz', **grown(MannequinOptions()))"
	$(PY) -c "from garment_sim_ros.body.mannequin.mannequin import mannequin; \
	from garment_sim_ros.colliders.fit_cache import SHIPPED, content_key, kept_text; \
	from garment_sim_ros.colliders.fitting import fit_colliders; \
	from garment_sim_ros.params import ColliderOptions; \
	body, options = mannequin(), ColliderOptions(); \
	SHIPPED.write_text(kept_text(content_key(body, options), fit_colliders(body, options)))"

clean: ## Everything that was made here
	rm -rf .venv .machines .peers out build install log *.egg-info .*_cache .hypothesis
	find garment_sim_ros test -name __pycache__ -type d -prune -exec rm -rf {} +
