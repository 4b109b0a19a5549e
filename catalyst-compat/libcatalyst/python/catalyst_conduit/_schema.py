"""A tree of types: what a node holds, without the data."""

import json

from ._datatype import DataType
from ._library import Error


class Schema:
    """A tree of `DataType`s: `schema["a/b"] = DataType.float64(10)`. `Node.set` makes a node of it whose numbers are 0."""

    def __init__(self, value=None):
        self._dtype = DataType.empty()
        # The children by their names, or in order; `None` for a leaf.
        self._children = None
        self._parent = None
        if value is not None:
            self.set(value)

    # ---- Setting.
    def set(self, value):
        """Takes over a `DataType`, or a copy of another `Schema`."""
        if isinstance(value, DataType):
            self._children = {} if value.is_object() else [] if value.is_list() else None
            self._dtype = DataType(value)
        elif isinstance(value, Schema):
            copies = [(name, Schema(child)) for name, child in value._named()]
            self._dtype = DataType(value._dtype)
            self._children = None
            if value._children is not None:
                is_list = isinstance(value._children, list)
                self._children = [copy for _, copy in copies] if is_list else dict(copies)
            for _, copy in copies:
                copy._parent = self
        else:
            raise TypeError(f"Schema.set takes a DataType or a Schema, not {type(value).__name__}")

    def reset(self):
        """Empties the schema."""
        self.set(DataType.empty())

    def __setitem__(self, path, value):
        self.fetch(path).set(value)

    # ---- Places.
    def _named(self):
        """The children with their names, which are empty in a list."""
        if isinstance(self._children, dict):
            return list(self._children.items())
        return [("", child) for child in self._children or []]

    def add_child(self, name):
        """The child of a name, which may hold a '/'; it is made where it is not there."""
        if not isinstance(self._children, dict):
            self.set(DataType.object())
        if name not in self._children:
            self._children[name] = self._new()
        return self._children[name]

    def _new(self):
        child = Schema()
        child._parent = self
        return child

    def append(self):
        """A new entry at the end of a list."""
        if not isinstance(self._children, list):
            self.set(DataType.list())
        self._children.append(self._new())
        return self._children[-1]

    def fetch(self, path):
        """The place at a path, which is made where it is not there."""
        place = self
        for name in filter(None, path.split("/")):
            place = place._up() if name == ".." else place.add_child(name)
        return place

    def fetch_existing(self, path):
        """The place at a path, which must be there."""
        place = self._find(path)
        if place is None:
            raise Error(f"'{path}' is not there")
        return place

    def _up(self):
        if self._parent is None:
            raise Error("there is nothing above the root")
        return self._parent

    def _find(self, path):
        place = self
        for name in filter(None, path.split("/")):
            if name == "..":
                place = place._parent
            else:
                place = place._children.get(name) if isinstance(place._children, dict) else None
            if place is None:
                return None
        return place

    def __getitem__(self, path):
        return self.child(path) if isinstance(path, int) else self.fetch_existing(path)

    def child(self, index=None, name=None):
        """A child by its number or its name."""
        if isinstance(index, str):
            index, name = None, index
        if name is not None:
            if not self.has_child(name):
                raise Error(f"there is no child '{name}'")
            return self._children[name]
        children = [child for _, child in self._named()]
        if not 0 <= index < len(children):
            raise Error(f"there is no child {index}; there are {len(children)}")
        return children[index]

    def children(self):
        """The children in order."""
        return iter([child for _, child in self._named()])

    __iter__ = children

    def child_names(self):
        """The names of the children in order."""
        return [name for name, _ in self._named()]

    def number_of_children(self):
        """How many children there are."""
        return len(self._named())

    def has_child(self, name):
        """Whether there is a child of a name."""
        return isinstance(self._children, dict) and name in self._children

    def has_path(self, path):
        """Whether there is something at a path."""
        return self._find(path) is not None

    __contains__ = has_path

    def remove(self, path=None, index=None):
        """Removes what is at a path, or a child by its number."""
        if path is not None:
            place = self.fetch_existing(path)
            place._up()._drop(place)
        else:
            self._drop(self.child(index))

    def remove_child(self, name):
        """Removes the child of a name, which may hold a '/'."""
        self._drop(self.child(name=name))

    def _drop(self, child):
        child._parent = None
        if isinstance(self._children, dict):
            self._children = {name: other for name, other in self._children.items() if other is not child}
        else:
            self._children = [other for other in self._children if other is not child]

    def rename_child(self, old, new):
        """Gives a child another name, which no other has."""
        self.child(name=old)
        if self.has_child(new):
            raise Error(f"there is a child '{new}' already")
        self._children = {new if name == old else name: child for name, child in self._children.items()}

    def parent(self):
        """The schema above, or `None`."""
        return self._parent

    def is_root(self):
        """Whether there is nothing above."""
        return self._parent is None

    def name(self):
        """The name below the parent."""
        names = [] if self._parent is None else [name for name, child in self._parent._named() if child is self]
        return names[0] if names else ""

    def path(self):
        """The path from the root."""
        above = "" if self._parent is None else self._parent.path()
        return f"{above}/{self.name()}" if above else self.name()

    # ---- What is held.
    def dtype(self):
        """The type of what is here."""
        return DataType(self._dtype)

    def is_empty(self):
        """Whether nothing is here."""
        return self._dtype.is_empty()

    def is_object(self):
        """Whether the children have names."""
        return self._dtype.is_object()

    def is_list(self):
        """Whether the children are in order, without names."""
        return self._dtype.is_list()

    def _leaves(self):
        if self._children is None:
            return [self._dtype]
        return [leaf for _, child in self._named() for leaf in child._leaves()]

    def total_strided_bytes(self):
        """The bytes of all leaves with what lies between their elements."""
        return sum(leaf.strided_bytes() for leaf in self._leaves())

    def total_bytes_compact(self):
        """The bytes of all elements alone."""
        return sum(leaf.bytes_compact() for leaf in self._leaves())

    def spanned_bytes(self):
        """The bytes that memory must have for every leaf to lie in it."""
        return max((leaf.spanned_bytes() for leaf in self._leaves()), default=0)

    def is_compact(self):
        """Whether nothing lies between elements."""
        return self.total_strided_bytes() == self.total_bytes_compact()

    def compatible(self, other):
        """Whether what is of this schema has room for what is of another."""
        if isinstance(self._children, dict) and isinstance(other._children, dict):
            shared = (name for name in other._children if name in self._children)
            return all(self._children[name].compatible(other._children[name]) for name in shared)
        if isinstance(self._children, list) and isinstance(other._children, list):
            enough = len(self._children) >= len(other._children)
            return enough and all(own.compatible(theirs) for own, theirs in zip(self._children, other._children))
        return self._dtype.compatible(other._dtype)

    def equals(self, other):
        """Whether trees, types and layouts are the same."""
        own, theirs = self._named(), other._named()
        return (
            self._dtype.equals(other._dtype)
            and [name for name, _ in own] == [name for name, _ in theirs]
            and all(one.equals(another) for (_, one), (_, another) in zip(own, theirs))
        )

    def compact_to(self, other):
        """Makes another schema of this one, whose leaves lie one behind the other, without anything between."""
        compact = Schema(self)
        offset = 0
        for leaf in compact._leaves():
            leaf.set_offset(offset)
            leaf.set_stride(leaf.element_bytes())
            offset += leaf.bytes_compact()
        other.set(compact)

    # ---- Texts.
    def to_json(self, indent=2, depth=0, pad=" ", eoe="\n"):
        """The schema as JSON."""
        if self._children is None:
            return self._dtype.to_json()
        is_list = isinstance(self._children, list)
        opening, closing = "[]" if is_list else "{}"
        outer, inner = pad * (indent * depth), pad * (indent * (depth + 1))
        lines = []
        for name, child in self._named():
            text = child.to_json(indent, depth + 1, pad, eoe)
            lines.append(inner + (text if is_list else f"{_quoted(name)}: {text}"))
        return f"{opening}{eoe}{f',{eoe}'.join(lines)}{eoe}{outer}{closing}" if lines else opening + closing

    def to_yaml(self, indent=2, depth=0, pad=" ", eoe="\n"):
        """The schema as YAML."""
        outer = pad * (indent * depth)
        if self._children is None:
            return "".join(f"{outer}{name}: {value}{eoe}" for name, value in self._dtype._entries())
        lines = []
        for name, child in self._named():
            lines.append(f"{outer}-{eoe}" if isinstance(self._children, list) else f"{outer}{_quoted(name)}: {eoe}")
            lines.append(child.to_yaml(indent, depth + 1, pad, eoe))
        return "".join(lines)

    def to_string(self, protocol="json", indent=2, depth=0, pad=" ", eoe="\n"):
        """The schema as a text of a protocol, "json" or "yaml"."""
        writers = {"json": self.to_json, "yaml": self.to_yaml}
        if protocol not in writers:
            raise ValueError(f"Schema.to_string takes {' or '.join(writers)}, not {protocol!r}")
        return writers[protocol](indent, depth, pad, eoe)

    def __str__(self):
        return self.to_json()

    __repr__ = __str__


def _quoted(name):
    return json.dumps(name, ensure_ascii=False)
