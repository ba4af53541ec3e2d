"""Real nodes in processes of their own, and a probe that talks to them."""

import os
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from ros_input.nursery import Nursery, started
from ros_input.one_process import OUTFIT, Command
from ros_input.processes import NodeProcess, Probe, wait_until

from garment_sim_ros.cli.node_processes import own_network


@pytest.fixture(scope="session", autouse=True)
def _own_network() -> Iterator[None]:
    """Nodes of this run meet each other and nobody else."""
    names = own_network()
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(names)
    yield
    for name, value in before.items():
        if value is None:
            del os.environ[name]
        else:
            os.environ[name] = value


@pytest.fixture(scope="session")
def nursery() -> Iterator[Nursery]:
    """What nodes come from."""
    made = Nursery()
    yield made
    made.end()


@pytest.fixture(scope="module")
def start_node(nursery: Nursery) -> Iterator[Callable[..., NodeProcess]]:
    """Starts nodes that end with the module; `apart`: it imports all by itself."""
    nodes: list[NodeProcess] = []

    def start(name: str, namespace: str, *, apart: bool = False, **parameters: Any) -> NodeProcess:
        begin = started if apart else nursery.start
        nodes.append(NodeProcess(name, namespace, begin=begin, **parameters))
        return nodes[-1]

    yield start
    for process in nodes:
        process.end()


@pytest.fixture(scope="module")
def make_probe() -> Iterator[Callable[[str], Probe]]:
    """Makes probes that end with the module."""
    made: list[Probe] = []

    def make(namespace: str) -> Probe:
        made.append(Probe(namespace))
        return made[-1]

    yield make
    for probe in made:
        probe.close()


@pytest.fixture(scope="session")
def until() -> Callable[..., Any]:
    """`wait_until`."""
    return wait_until


@pytest.fixture(scope="session")
def outfit(tmp_path_factory: pytest.TempPathFactory) -> str:
    """An outfit file of one small garment."""
    path = tmp_path_factory.mktemp("outfit") / "outfit.yaml"
    path.write_text(OUTFIT)
    return str(path)


@pytest.fixture
def command(nursery: Nursery) -> Iterator[Callable[..., Command]]:
    """Starts `garment-sim run`; it ends with the test. `apart`: it imports all by itself."""
    begun: list[Command] = []

    def start(*words: str, apart: bool = False) -> Command:
        begun.append(Command(*words, begin=started if apart else nursery.start))
        return begun[-1]

    yield start
    for process in begun:
        process.end()
