"""A solver on several ranks, by mpi4py: any communicator, and a mistake of one rank is an error on all."""

import json

import pytest
from conftest import on_ranks
from tombolo import _native

PROGRAM = """
import faulthandler, json, sys
# A rank that waits for one that has left would wait for good.
faulthandler.dump_traceback_later(60, exit=True)
import numpy as np
import tombolo
from mpi4py import MPI

world = MPI.COMM_WORLD

def slab(rank):
    "The unit cube in eight hexahedra, beside those of the ranks before."
    axis = np.linspace(0, 1, 3)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3) + [rank, 0, 0]
    n = np.arange(27).reshape(3, 3, 3)
    corners = [n[:-1, :-1, :-1], n[1:, :-1, :-1], n[1:, 1:, :-1], n[:-1, 1:, :-1],
               n[:-1, :-1, 1:], n[1:, :-1, 1:], n[1:, 1:, 1:], n[:-1, 1:, 1:]]
    cells = np.stack(corners, -1).reshape(-1, 8)
    heights = points[cells, 2].max(1)
    faces = {"top": cells[heights == 1][:, 4:], "bottom": cells[heights == 0.5][:, :4]}
    place = np.rint(2 * points).astype(int)
    numbers = {"global_vertices": place @ [9, 3, 1], "global_cells": np.arange(8) + 8 * rank}
    return points, tombolo.Mesh(points, {"hexahedron": cells}, {"T": np.zeros(27)}, faces=faces, **numbers)

def tell(**told):
    # In one piece, among those of the others.
    sys.stdout.write("told " + json.dumps({"rank": world.rank, **told}) + "\\n")
    sys.stdout.flush()
"""

SQUEEZED = """
parts = [world.Split(world.rank // int(sys.argv[1]), world.rank)]
if sys.argv[2] == "freed":
    parts.append(parts[0].Dup())
ranks = parts[-1]
squeeze = {"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.2]}}
orders = [{"at": {"cycle": 1}, "order": {"edits": [squeeze]}}, {"at": {"cycle": 3}, "order": {"undo": 1}}]
points, mesh = slab(ranks.rank)
reference, tops = points.copy(), []
with tombolo.Adaptor({"version": 1}, orders=orders, communicator=ranks, output=sys.argv[3]) as adaptor:
    if sys.argv[2] == "freed":
        ranks.Free()
    for cycle in range(6):
        # Groups go on by themselves.
        for _ in range(1 + world.rank // int(sys.argv[1])):
            adaptor.looks_at(cycle, 0.1 * cycle, 0.1)
        motion = adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": mesh}).motion
        if motion is not None:
            points[:] = motion.coordinates
        tops.append(points[:, 2].max())
tell(size=parts[0].size, tops=tops, restored=np.array_equal(points, reference),
     orders=[order["status"] for order in adaptor.report["orders"]])
"""


def told_by(program, ranks, *arguments):
    """What each rank told, by its number."""
    said = on_ranks(ranks, PROGRAM + program, *arguments)
    assert said.returncode == 0, said.stdout + said.stderr
    lines = [json.loads(line[5:]) for line in said.stdout.splitlines() if line.startswith("told ")]
    assert sorted(line["rank"] for line in lines) == list(range(ranks)), said.stdout + said.stderr
    return sorted(lines, key=lambda line: line["rank"])


@pytest.mark.parametrize(("ranks", "size"), [(1, 1), (2, 2), (3, 2), (3, 3)])
@pytest.mark.parametrize("how", ["kept", "freed"])
def test_the_ranks_of_any_communicator_change_their_shape(tmp_path, ranks, size, how):
    for told in told_by(SQUEEZED, ranks, size, how, tmp_path):
        group = told["rank"] // size
        assert told["size"] == min(size, ranks - group * size)
        assert told["tops"] == pytest.approx([1, 0.8, 0.8, 1, 1, 1]) and told["restored"], told
        # They are told on the first rank of each group.
        is_first = told["rank"] % size == 0
        assert told["orders"] == (["applied", "applied"] if is_first else []), told


NULL = """
try:
    tombolo.Adaptor(communicator=MPI.COMM_NULL)
except tombolo.ConfigurationError as error:
    tell(text=str(error))
"""


def test_the_null_communicator_is_told():
    (told,) = told_by(NULL, 1)
    assert told["text"].startswith("the communicator: found") and "expected one of mpi4py" in told["text"]


FAILING = """
mine = world.rank == world.size - 1
points, mesh = slab(world.rank)

class Interrupted:
    def __array__(self, *_, **__):
        raise {"interrupted": KeyboardInterrupt, "exits": SystemExit, "memory": MemoryError}[sys.argv[1]]("enough")

def step(adaptor, cycle, time, given):
    adaptor.execute(cycle, time, 0.1, {"solid": given})

def run(name, adaptor):
    if name == "no vertex" and mine:
        mesh.cells["hexahedron"][0, 0] = 1000
    step(adaptor, 0, 0.0, mesh)
    if name == "cycle":
        step(adaptor, -1 if mine else 1, 0.1, mesh)
    if name == "time":
        step(adaptor, 1, None if mine else 0.1, mesh)
    if name == "no time":
        step(adaptor, 1, float("nan") if mine else 0.1, mesh)
    if name == "no mesh":
        step(adaptor, 1, 0.1, 3 if mine else mesh)
    if name in ("interrupted", "exits", "memory"):
        step(adaptor, 1, 0.1, {"points": Interrupted()} if mine else mesh)
    if name == "an exception" and mine:
        raise ZeroDivisionError("of one rank")
    if name == "an early end" and mine:
        return
    for cycle in range(1, 20):
        step(adaptor, cycle, 0.1 * cycle, mesh)

settings = {
    "no version": {"configuration": {"version": 7 if mine else 1}},
    "an object": {"configuration": {"version": object() if mine else 1}},
    "no range": {"parameters": {"x": 3 if mine else (1, 0, 3)}},
    "a low range": {"parameters": {"x": (4 if mine else 1, 0, 3)}},
    "no condition": {"conditions": {"top": "wal" if mine else "wall"}},
    "no journal": {"replay": 3 if mine else None},
    "another configuration": {"configuration": {"version": 1, "description": "b" if mine else "a"}},
    "other parameters": {"parameters": {"x": (world.rank, 0, 3)}},
    "other conditions": {"conditions": {"top": "inflow" if mine else "wall"}},
}
name = sys.argv[1]
given = {"configuration": {"version": 1, "steering": {"poll_steps": 3}}, **settings.get(name, {})}
try:
    with tombolo.Adaptor(communicator=world, output=sys.argv[2], **given) as adaptor:
        run(name, adaptor)
    tell(kind="none", text="")
except BaseException as error:
    tell(kind=type(error).__name__, text=str(error))
"""

EMPTY = """
points, mesh = slab(world.rank)
if world.rank == 1:
    mesh.faces = {"top": [], "bottom": {"quad": []}}
with tombolo.Adaptor(communicator=world, output=sys.argv[1]) as adaptor:
    for cycle in range(2):
        adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": mesh})
tell(done=True)
"""


@pytest.mark.skipif(not _native.DISTRIBUTED, reason="built without MPI")
def test_a_rank_without_faces_says_so_by_empty_lists(tmp_path):
    assert all(told["done"] for told in told_by(EMPTY, 2, tmp_path))


MISTAKES = {
    "cycle": ("StepError", "cycle: found -1"),
    "time": ("StepError", "time: found None; expected a number"),
    "no time": ("StepError", "time is NaN"),
    "no mesh": ("MeshError", "expected a tombolo.Mesh"),
    "no vertex": ("MeshError", "vertex 1000 does not exist"),
    "no version": ("ConfigurationError", "configuration:1:"),
    "an object": ("ConfigurationError", "a object is no JSON"),
    "no range": ("ConfigurationError", "expected (value, minimum, maximum)"),
    "a low range": ("ConfigurationError", "x"),
    "no condition": ("ConfigurationError", "'wal'"),
    "no journal": ("ConfigurationError", "replay: found 3"),
    "another configuration": ("ConfigurationError", "not those of rank 0"),
    "other parameters": ("ConfigurationError", "not those of rank 0"),
    "other conditions": ("ConfigurationError", "not those of rank 0"),
}


@pytest.mark.skipif(not _native.DISTRIBUTED, reason="built without MPI")
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_of_one_rank_is_one_error_on_all(tmp_path, name):
    kind, text = MISTAKES[name]
    for told in told_by(FAILING, 2, name, tmp_path):
        assert told["kind"] == kind and text in told["text"], told


FAILED = "rank 2: the solver has failed: "
ENDS = {
    "an exception": ("FailedError", FAILED + "ZeroDivisionError: of one rank", "ZeroDivisionError"),
    "an early end": ("StepError", "ended on other ranks", "none"),
    "interrupted": ("FailedError", FAILED + "KeyboardInterrupt: enough", "KeyboardInterrupt"),
    "exits": ("FailedError", FAILED + "SystemExit: enough", "SystemExit"),
    "memory": ("FailedError", FAILED + "MemoryError: enough", "MemoryError"),
}


@pytest.mark.skipif(not _native.DISTRIBUTED, reason="built without MPI")
@pytest.mark.parametrize("name", ENDS)
def test_the_end_of_one_rank_holds_none_up(tmp_path, name):
    kind, text, own = ENDS[name]
    *others, last = told_by(FAILING, 3, name, tmp_path)
    assert last["kind"] == own, last
    for told in others:
        assert told["kind"] == kind and text in told["text"], told
