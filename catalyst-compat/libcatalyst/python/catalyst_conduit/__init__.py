"""Conduit's node from Python, over the functions of libcatalyst.

    node = Node()
    node["catalyst/state/timestep"] = 3
    mesh = node["catalyst/channels/grid/data"]
    mesh["fields/p/values"].set_external(pressure)   # a NumPy array, read where it is

A place that holds nothing, an object or a list is a `Node` itself; one that holds a text is a `str`, one number a NumPy scalar,
several an array that shows the node's memory. `fetch` gives the `Node` in each case. A `DataType` says what a leaf holds and how it
lies in memory, a `Schema` so for a tree.
"""

import ctypes
import numbers

import numpy

from ._datatype import DataType
from ._library import TYPES, Error, called, taken, text_of
from ._schema import Schema

__all__ = ["DataType", "Error", "Node", "Schema", "about", "blueprint"]

_ORDERS = {0: "=", 1: ">", 2: "<"}


class _Memory:
    """Memory of a node for NumPy; the array that is made of it keeps the node."""

    def __init__(self, owner, interface):
        self.owner = owner
        self.__array_interface__ = interface


def _array(value):
    """An array of one direction, of a type that a node can hold."""
    array = numpy.asarray(value)
    if array.dtype == bool:
        array = array.astype(numpy.uint8)
    if array.dtype.name not in TYPES:
        raise TypeError(f"a node holds {', '.join(TYPES)} and texts, not {array.dtype.name}")
    return array.reshape(1) if array.ndim == 0 else array


class Node:
    """A tree, or a place in one, which keeps the tree alive."""

    def __init__(self, value=None):
        self._handle = called("catalyst_conduit_node_create")
        self._root = self
        self._lent = {}
        # Trees with which this one has changed its children: places of either may lie in the other.
        self._swapped = []
        if value is not None:
            self.set(value)

    @classmethod
    def _at(cls, handle, root):
        place = cls.__new__(cls)
        place._handle = handle
        place._root = root
        return place

    def __del__(self):
        if getattr(self, "_root", None) is self and called is not None:
            called("catalyst_conduit_node_destroy", self.handle)

    @property
    def handle(self):
        """The node of the C interface."""
        return ctypes.c_void_p(self._handle)

    def _call(self, name, *arguments):
        return called("catalyst_conduit_node_" + name, self.handle, *arguments)

    def _node(self, name, *arguments):
        return Node._at(self._call(name, *arguments), self._root)

    # ---- Setting.
    def set(self, value):
        """Copies a number, a text, an array, another node, or a `dict` or a list of such; numbers in a list are an array. Of a
        `Schema` or a `DataType` it holds zeros."""
        if isinstance(value, Node):
            self._call("set_node", value.handle)
        elif isinstance(value, (Schema, DataType)):
            compact = Schema()
            Schema(value).compact_to(compact)
            zeros = ctypes.create_string_buffer(max(compact.total_bytes_compact(), 1))
            self._call("generate", compact.to_json(), "conduit_json", zeros)
        elif isinstance(value, dict):
            self.reset()
            for name, entry in value.items():
                self.fetch(name).set(entry)
        elif isinstance(value, (str, bytes)):
            self._call("set_char8_str", value)
        elif isinstance(value, (list, tuple)) and not all(isinstance(entry, numbers.Number) for entry in value):
            self.reset()
            for entry in value:
                self.append().set(entry)
        else:
            array = _array(value)
            # The array may show what this node holds, so that is let go last.
            copy = Node()
            copy._lay(numpy.ascontiguousarray(array, array.dtype.newbyteorder("=")).reshape(-1), "set_")
            self._call("move", copy.handle)

    def set_external(self, value):
        """Refers to an array where it is; the tree keeps it alive until something else is set here."""
        if isinstance(value, Node):
            self._call("set_external_node", value.handle)
            self._root._lent[self.path()] = value
            return
        array = _array(value) if isinstance(value, numpy.ndarray) else None
        if array is None:
            raise TypeError(f"set_external takes a NumPy array or a Node, not {type(value).__name__}")
        if array.ndim > 1 and array.flags.c_contiguous:
            array = array.reshape(-1)
        if array.ndim != 1 or array.strides[0] < array.itemsize or not array.dtype.isnative or array.dtype != value.dtype:
            raise TypeError("set_external takes an array that runs forward in one direction, of numbers as the machine has them")
        self._lay(array, "set_external_")
        self._root._lent[self.path()] = array

    def _lay(self, array, how):
        stride = array.strides[0] if array.size > 1 else array.itemsize
        layout = (array.size, 0, stride, array.itemsize, 0)
        self._call(f"{how}{array.dtype.name}_ptr_detailed", ctypes.c_void_p(array.ctypes.data), *layout)

    def set_path(self, path, value):
        """`set` at a path."""
        self.fetch(path).set(value)

    def set_path_external(self, path, value):
        """`set_external` at a path."""
        self.fetch(path).set_external(value)

    def __setitem__(self, path, value):
        (self.child(path) if isinstance(path, int) else self.fetch(path)).set(value)

    def reset(self):
        """Empties the node."""
        self._call("reset")
        if self._root is self:
            self._lent.clear()

    # ---- Places.
    def fetch(self, path):
        """The node at a path, which is made where it is not there."""
        return self._node("fetch", path)

    def fetch_existing(self, path):
        """The node at a path, which must be there."""
        return self._node("fetch_existing", path)

    def child(self, index=None, name=None):
        """A child by its number or its name, which may hold a '/'."""
        if isinstance(index, str):
            index, name = None, index
        return self._node("child", index) if name is None else self._node("child_by_name", name)

    def add_child(self, name):
        """The child of a name, which may hold a '/'; it is made where it is not there."""
        return self._node("add_child", name)

    def append(self):
        """A new entry at the end of a list."""
        return self._node("append")

    def parent(self):
        """The node above, or `None`."""
        handle = self._call("parent")
        return Node._at(handle, self._root) if handle else None

    def __getitem__(self, path):
        return (self.child(path) if isinstance(path, int) else self.fetch(path)).value()

    def children(self):
        """The children in order."""
        return (self.child(index) for index in range(self.number_of_children()))

    __iter__ = children

    def child_names(self):
        """The names of the children in order."""
        return [child.name() for child in self.children()]

    def number_of_children(self):
        """How many children there are."""
        return self._call("number_of_children")

    def number_of_elements(self):
        """How many elements a leaf has."""
        return self._call("number_of_elements")

    def has_child(self, name):
        """Whether there is a child of a name."""
        return bool(self._call("has_child", name))

    def has_path(self, path):
        """Whether there is something at a path."""
        return bool(self._call("has_path", path))

    __contains__ = has_path

    def remove(self, path=None, index=None):
        """Removes what is at a path, or a child by its number."""
        if path is None:
            self._call("remove_child", index)
        else:
            self._call("remove_path", path)

    def remove_child(self, name):
        """Removes the child of a name, which may hold a '/'."""
        self._call("remove_child_by_name", name)

    def rename_child(self, old, new):
        """Gives a child another name."""
        self._call("rename_child", old, new)

    def name(self):
        """The name below the parent."""
        return taken(self._call("name"))

    def path(self):
        """The path from the root."""
        return taken(self._call("path"))

    # ---- What is held.
    def _type(self):
        return self._call("dtype")

    def dtype(self):
        """The `DataType` of what is here."""
        return DataType._of(self._type())

    def schema(self):
        """A `Schema` of the tree as it is now."""
        schema = self._schema()
        if not self.is_root():
            # It is no root either.
            schema._parent = Schema(DataType.object())
            schema._parent._children[self.name()] = schema
        return schema

    def _schema(self):
        schema = Schema()
        dtype = self.dtype()
        schema.set(dtype)
        for child in self.children():
            place = schema.add_child(child.name()) if dtype.is_object() else schema.append()
            place.set(child._schema())
        return schema

    def _numpy(self):
        """The NumPy type of what a leaf holds, `str` of a text, `None` of others."""
        dtype = self.dtype()
        if dtype.is_string():
            return str
        return numpy.dtype(dtype.name()).newbyteorder(_ORDERS[dtype.endianness()]) if dtype.is_number() else None

    def value(self):
        """A text, a number or an array; the node itself where it holds none of these."""
        held = self._numpy()
        if held is None:
            return self
        if held is str:
            return text_of(self._call("as_char8_str"))
        count = self._call("number_of_elements")
        if count == 0:
            return numpy.empty(0, held)
        stride = called("catalyst_conduit_datatype_stride", self._type())
        address = self._call("element_ptr", 0)
        interface = {"version": 3, "shape": (count,), "strides": (stride,), "typestr": held.str, "data": (address, False)}
        array = numpy.asarray(_Memory(self._root, interface))
        return array[0] if count == 1 else array

    def update(self, other):
        """Takes over what another tree has, and keeps the rest."""
        self._call("update", other.handle)

    def update_compatible(self, other):
        """Takes over what another tree has where this one has it too."""
        self._call("update_compatible", other.handle)

    def update_external(self, other):
        """Refers to what another tree has, and keeps the rest."""
        self._call("update_external", other.handle)
        self._root._swapped.append(other._root)

    def swap(self, other):
        """Changes what is here with what another node has."""
        self._call("swap", other.handle)
        if self._root is not other._root:
            self._root._swapped.append(other._root)
            other._root._swapped.append(self._root)

    def move(self, other):
        """Takes over what another node has, which is empty then."""
        self._call("move", other.handle)
        if self._root is not other._root:
            self._root._swapped.append(other._root)

    def compact_to(self, other):
        """Makes another node a copy whose data lie one behind the other, without anything between."""
        self._call("compact_to", other.handle)

    def compatible(self, other):
        """Whether everything of this tree is there in another with the same types."""
        return bool(self._call("compatible", other.handle))

    def diff(self, other, info, epsilon=1e-12):
        """Whether two trees differ; how, is in `info`."""
        return bool(self._call("diff", other.handle, info.handle, float(epsilon)))

    def diff_compatible(self, other, info, epsilon=1e-12):
        """Whether another tree lacks something of this one or has it differently; how, is in `info`."""
        return bool(self._call("diff_compatible", other.handle, info.handle, float(epsilon)))

    def total_strided_bytes(self):
        """The bytes of all leaves with what lies between their elements."""
        return self._call("total_strided_bytes")

    def total_bytes_compact(self):
        """The bytes of all elements alone."""
        return self._call("total_bytes_compact")

    def total_bytes_allocated(self):
        """The bytes that the tree holds itself."""
        return self._call("total_bytes_allocated")

    def is_compact(self):
        """Whether nothing lies between elements."""
        return bool(self._call("is_compact"))

    def contiguous_with(self, other):
        """Whether the data of this tree follow those of another."""
        return bool(self._call("contiguous_with_node", other.handle))

    def info(self):
        """What the tree takes of memory."""
        info = Node()
        self._call("info", info.handle)
        return info

    def is_root(self):
        """Whether there is nothing above."""
        return bool(self._call("is_root"))

    def is_data_external(self):
        """Whether the data are somebody else's."""
        return bool(self._call("is_data_external"))

    def is_contiguous(self):
        """Whether the data of the tree follow each other."""
        return bool(self._call("is_contiguous"))

    # ---- Texts and files.
    def _text(self, writer, **options):
        chosen = Node({name: value for name, value in options.items() if value is not None})
        return taken(self._call(writer + "_with_options", chosen.handle))

    def to_json(self, protocol="json", indent=2, depth=0, pad=" ", eoe="\n"):
        """The tree as JSON of a protocol: "json", "conduit_json" or "conduit_base64_json"."""
        return self._text("to_json", protocol=protocol, indent=indent, depth=depth, pad=pad, eoe=eoe)

    def to_yaml(self, protocol="yaml", indent=2, depth=0, pad=" ", eoe="\n"):
        """The tree as YAML."""
        return self._text("to_yaml", protocol=protocol, indent=indent, depth=depth, pad=pad, eoe=eoe)

    def to_string(self, protocol="yaml", indent=2, depth=0, pad=" ", eoe="\n"):
        """The tree as a text of a protocol: "yaml", "json", "conduit_json" or "conduit_base64_json"."""
        return self._text("to_string", protocol=protocol, indent=indent, depth=depth, pad=pad, eoe=eoe)

    def to_summary_string(
        self, num_children_threshold=None, num_elements_threshold=None, indent=2, depth=0, pad=" ", eoe="\n"
    ):
        """The tree as YAML, long lists and arrays shortened."""
        thresholds = {
            "num_children_threshold": num_children_threshold,
            "num_elements_threshold": num_elements_threshold,
        }
        return self._text("to_summary_string", indent=indent, depth=depth, pad=pad, eoe=eoe, **thresholds)

    def __str__(self):
        return self.to_summary_string()

    __repr__ = __str__

    def print_detailed(self):
        """Prints the tree with its types."""
        self._call("print_detailed")

    def parse(self, text, protocol="yaml"):
        """Fills the node with what a text holds."""
        self._call("parse", text, protocol)

    def load(self, path, protocol=""):
        """Fills the node with what a file holds."""
        self._call("load", str(path), protocol)

    def save(self, path, protocol=""):
        """Writes the tree to a file."""
        self._call("save", str(path), protocol)


def about():
    """What the library says of its Conduit."""
    node = Node()
    called("catalyst_conduit_about", node.handle)
    return node


from . import blueprint  # noqa: E402 - it needs the Node
