"""Catalyst and the node from Python: what is set is read back, what is lent is not copied, and errors are exceptions."""

import ctypes
import gc
import re
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


# Every function that is called has its types, the very ones of the headers, and keeps them. Standard input has the headers.
of_c = {"void": None, "int": ctypes.c_int, "conduit_index_t": ctypes.c_int64, "double": ctypes.c_double}
of_c["enum catalyst_status"] = ctypes.c_int
of_c["conduit_float64"] = ctypes.c_double


def of_python(text, is_argument):
    text = re.sub(r"\s+", " ", text.strip())
    if "(*" in text:
        return ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_char_p, ctypes.c_int)
    if is_argument and re.match(r"const char ?\*", text):
        return ctypes.c_char_p
    if "*" in text:
        return ctypes.c_void_p
    return of_c[re.sub(r" \w+$", "", text) if is_argument else text]


def arguments_of(text):
    # Of a handler too, whose own arguments are in parentheses.
    return [part for part in re.split(r",(?![^()]*\))", text) if part.strip() != "void"]


declared = {}
# Without attributes, and with each declaration on a line.
headers = re.sub(r"__attribute__ ?\(\(.*?\)\)\)?", "", re.sub(r"\s+", " ", sys.stdin.read())).replace(";", ";\n")
for result, name, arguments in re.findall(r"([\w ]+?[ *]+)(catalyst_\w+) ?\((.*)\) ?;", headers):
    declared[name] = (result, arguments)
from catalyst_conduit._library import FUNCTIONS

assert len(declared) > 400, len(declared)
for name, function in FUNCTIONS.items():
    result, arguments = declared[name]
    result = re.sub(r"^extern \"C\" ", "", result.strip())
    assert function.restype == of_python(result, False), (name, function.restype, result)
    expected = [of_python(argument, True) for argument in arguments_of(arguments)]
    if name.startswith("catalyst_conduit_utils_set_"):
        assert [issubclass(kind, ctypes._CFuncPtr) for kind in function.argtypes] == [True]
        continue
    assert function.argtypes == expected, (name, function.argtypes, arguments)
    assert conduit._library.FUNCTIONS[name] is function

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

# Addresses are whole: here memory lies beyond what an int can say.
assert conduit.Node().handle.value and all(
    child.handle.value == node.fetch(child.path()).handle.value for child in node["types"]
)

# Types, and schemas of trees.
DataType, Schema = conduit.DataType, conduit.Schema
held = node.fetch("lent/x").dtype()
assert held.name() == "float64" and held.is_float64() and held.is_double() and held.is_floating_point()
assert held.number_of_elements() == 4 and held.stride() == 24 and held.element_bytes() == 8 and not held.is_compact()
assert held.strided_bytes() == 80 and held.bytes_compact() == 32 and held.endianness_matches_machine()
assert held.element_index(2) == held.offset() + 48 and not held.is_integer() and held.is_number()
assert node.fetch("a").dtype().is_object() and node.fetch("args").dtype().is_list()
assert [DataType.name_to_id(DataType.id_to_name(number)) for number in range(14)] == list(range(14))
for name in "int8 int16 int32 int64 uint8 uint16 uint32 uint64 float32 float64".split():
    made = getattr(DataType, name)(5)
    assert made.name() == name and made.id() == getattr(DataType, name + "_id")() and made.number_of_elements() == 5
    assert made.element_bytes() == numpy.dtype(name).itemsize == made.stride() and made.is_compact()
    assert made.is_signed_integer() == (name[0] == "i") and made.is_unsigned_integer() == (name[0] == "u")
    assert conduit.Node(made).dtype().name() == name and (conduit.Node(made).value() == [0] * 5).all()
assert DataType.c_unsigned_short().is_uint16() and DataType.c_long().is_int64() and DataType.index_t().is_index_t()
layout = DataType()
layout.set(dtype_name="uint32", num_elements=3, offset=4, stride=8, element_bytes=4)
assert layout.spanned_bytes() == 24 and layout.compatible(DataType.uint32(2)) and not layout.equals(DataType.uint32(3))
assert DataType(layout).equals(layout) and not DataType.uint32(2).compatible(layout)
assert layout.to_string("json") == layout.to_json() and '"stride": 8' in str(layout)
raises(ValueError, "float64", DataType.name_to_id, "float46")
raises(ValueError, "yaml or json", layout.to_string, "xml")

schema = Schema()
schema["mesh/x"] = DataType.float64(10)
schema["mesh/y"] = DataType.float32(10)
schema.add_child("with/slash").set(DataType.int8(3))
assert schema.has_child("with/slash") and not schema.has_path("with/slash") and schema.has_path("mesh/y")
assert schema.total_strided_bytes() == 123 and schema["mesh"].total_bytes_compact() == 120
assert schema["mesh/x"].path() == "mesh/x" and not schema["mesh"].is_root() and schema["mesh"].parent() is schema
made = conduit.Node(schema)
assert made.schema().is_root() and made.schema().total_strided_bytes() == 123
assert made.child(name="with/slash").dtype().number_of_elements() == 3 and (made["mesh/x"] == numpy.zeros(10)).all()
compact = Schema()
schema.compact_to(compact)
assert compact["mesh/y"].dtype().offset() == 80 and compact.spanned_bytes() == 123 and compact.is_compact()
assert made.schema().compatible(schema) and not made.fetch("mesh").schema().is_root()
schema.rename_child("with/slash", "plain")
assert schema.child_names() == ["mesh", "plain"]
raises(conduit.Error, "already", schema.rename_child, "plain", "mesh")
raises(conduit.Error, "nothing", schema.rename_child, "nothing", "other")
schema["mesh"].remove_child("x")
schema.remove(index=1)
assert schema["mesh"].child_names() == ["y"] and schema.number_of_children() == 1
ordered = Schema()
ordered.append().set(DataType.int32(2))
ordered.append().set(schema)
assert ordered.is_list() and conduit.Node(ordered).child(1)["mesh/y"].size == 10
parsed = conduit.Node()
parsed.parse(node.fetch("types").schema().to_json(), "json")
assert parsed["int8/dtype"] == "int8" and parsed["int8/number_of_elements"] == 3
parsed.parse(node.fetch("types").schema().to_yaml(), "yaml")
assert parsed["float64/dtype"] == "float64"
for empty in (Schema(), Schema(DataType.object())):
    assert conduit.Node(empty).number_of_children() == 0

# Children by names that a path cannot say.
slashed = conduit.Node()
slashed.add_child("a/b").set(5)
assert slashed.child(name="a/b").value() == 5 and slashed.child("a/b").value() == 5 and not slashed.has_path("a/b")
slashed.remove_child("a/b")
assert slashed.number_of_children() == 0

# Whole trees.
info = conduit.Node()
few, many = conduit.Node({"x": 1.0}), conduit.Node({"x": 1.0, "y": 2.0})
assert few.diff(many, info) and not few.diff_compatible(many, info) and many.diff_compatible(few, info)
gathered = conduit.Node()
node.fetch("lent").compact_to(gathered)
assert (gathered["x"] == values[:, 1]).all() and gathered.fetch("x").dtype().is_compact()
assert gathered.total_bytes_compact() == gathered.total_strided_bytes() == gathered.total_bytes_allocated()
one, other = conduit.Node({"one": 1}), conduit.Node()
other["lent"].set_external(numpy.full(1000, 3.0))
one.swap(other)
del other
gc.collect()
numpy.zeros(1000)
assert (one["lent"] == 3).all() and not one.has_path("one")
assert one.to_string("json") == one.to_json() and one.to_string() == one.to_yaml()
assert '"dtype":"float64"' in one.to_string("conduit_json").replace(" ", "")
assert one.to_json(indent=0, pad="", eoe="").count("\n") == 0
raises(conduit.Error, "xml", one.to_string, "xml")

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
