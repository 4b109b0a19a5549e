"""Catalyst and the node from Python: what is set is read back, what is lent is not copied, and errors are exceptions."""

import gc
import sys

import numpy

import catalyst
import catalyst_conduit as conduit
import catalyst_conduit.blueprint


def raises(kind, text, function, *arguments):
    try:
        function(*arguments)
    except kind as error:
        assert text in str(error), error
        return
    raise AssertionError(f"{function} raises nothing")


node = conduit.Node()
node["a/b"] = 3
node["a/c"] = "text"
node["a/d"] = [1.0, 2.0, 3.0]
node["flag"] = True
node["args"] = ["--one", "two"]
node["tree"] = {"x": numpy.float32(1.5), "y": {"z": -1}}
assert node["a/b"] == 3 and node["a/b"].dtype == numpy.int64
assert node["a/c"] == "text" and node["flag"] == 1 and node["args"][1] == "two"
assert (node["a/d"] == [1, 2, 3]).all()
assert node["tree/x"].dtype == numpy.float32 and node["tree/y/z"] == -1
assert node["a"].child_names() == ["b", "c", "d"] and node["a"].number_of_children() == 3
assert node.fetch("a/b").path() == "a/b" and node.fetch("a/b").parent().name() == "a"
assert "a/b" in node and not node.has_path("a/nothing") and [child.name() for child in node["tree"]] == ["x", "y"]
for kind in "int8 int16 int32 int64 uint8 uint16 uint32 uint64 float32 float64".split():
    node["types/" + kind] = numpy.arange(5, dtype=kind)[::2]
    assert node["types/" + kind].dtype == kind and (node["types/" + kind] == [0, 2, 4]).all()
node["a/d"] = node["a/d"][1:]
assert (node["a/d"] == [2, 3]).all()
node["a/d"][0] = 7
assert node["a/d"][0] == 7
node.remove("a/c")
assert node["a"].child_names() == ["b", "d"]
raises(conduit.Error, "'nothing' is not there", node.fetch_existing, "nothing")
raises(TypeError, "not complex128", node.set, 1j)

# What is lent is read where it is, and kept as long as the tree.
values = numpy.arange(12.0).reshape(4, 3)
node["lent/x"].set_external(values[:, 1])
node["lent/all"].set_external(values)
values[2, 1] = -5
assert node["lent/x"][2] == -5 and node["lent/all"][7] == -5
assert node.fetch("lent/x").is_data_external() and node.fetch("lent/x").value().strides == (24,)
node["lent/gone"].set_external(numpy.full(1000, 4.0))
gc.collect()
assert (node["lent/gone"] == 4).all()
raises(TypeError, "runs forward", node["lent/back"].set_external, values[::-1, 0])
raises(TypeError, "runs forward", node["lent/part"].set_external, values[:, :2])
raises(TypeError, "takes a NumPy array", node["lent/list"].set_external, [1, 2])

# A place keeps its tree, and an array the memory that it shows.
array = conduit.Node({"deep": {"values": numpy.ones(100)}})["deep/values"]
gc.collect()
assert array.sum() == 100

read = conduit.Node()
read.parse(node.to_json(), "json")
assert read["tree/y/z"] == -1 and "b: 3" in str(read)
read.parse("m: {coordsets: {c: {type: uniform, dims: {i: 2, j: 2}}}, topologies: {t: {type: uniform, coordset: c}}}")
info = conduit.Node()
assert conduit.blueprint.mesh.verify(read["m"], info) and info["valid"] == "true"
assert not conduit.blueprint.mesh.verify(node, info) and not conduit.blueprint.verify("mcarray", read, info)
assert conduit.blueprint.mesh.verify(read["m/topologies/t"], info, "topology")
assert not node.diff(node, info) and node.diff(read, info)

raises(catalyst.CatalystError, "status 1", catalyst.execute, node)
raises(TypeError, "takes a catalyst_conduit.Node", catalyst.initialize, {})
start = conduit.Node()
start["catalyst_load/implementation"] = "not-there"
raises(catalyst.CatalystError, "status 3", catalyst.initialize, start)
start["catalyst_load/implementation"] = sys.argv[1]
catalyst.initialize(start)
node["catalyst/state/timestep"] = 1
node["catalyst/state/time"] = 0.5
catalyst.execute(node)
about = conduit.Node()
catalyst.about(about)
assert about["catalyst/implementation"] == sys.argv[1], about
results = conduit.Node()
catalyst.results(results)
assert sys.argv[1] != "echo" or results["catalyst/seen"] == 1
catalyst.finalize(conduit.Node())
print("node.py: ok with", about["catalyst/implementation"])
