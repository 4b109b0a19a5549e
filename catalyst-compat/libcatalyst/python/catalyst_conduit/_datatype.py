"""What a leaf holds, and how it lies in memory."""

import sys

from ._library import TYPES, called

_NAMES = ["empty", "object", "list"] + TYPES + ["char8_str"]
_BYTES = [0, 0, 0] + [int("".join(filter(str.isdigit, name))) // 8 for name in TYPES] + [1]
_ORDERS = ["default", "big", "little"]
# The types of C by their names, as they are where Catalyst runs.
_C_TYPES = {
    "c_char": "int8",
    "c_short": "int16",
    "c_int": "int32",
    "c_long": "int64",
    "c_long_long": "int64",
    "c_signed_char": "int8",
    "c_signed_short": "int16",
    "c_signed_int": "int32",
    "c_signed_long": "int64",
    "c_signed_long_long": "int64",
    "c_unsigned_char": "uint8",
    "c_unsigned_short": "uint16",
    "c_unsigned_int": "uint32",
    "c_unsigned_long": "uint64",
    "c_unsigned_long_long": "uint64",
    "c_float": "float32",
    "c_double": "float64",
    "index_t": "int64",
}


class DataType:
    """A type, the number of elements, and their layout in bytes.

    `DataType.float64(10)` is ten numbers one beside the other; so for each type that a node holds.
    """

    def __init__(self, other=None):
        self._id, self._elements, self._offset, self._stride, self._element_bytes, self._endianness = (
            other._parts() if other is not None else (0, 0, 0, 0, 0, 0)
        )

    @classmethod
    def _of(cls, address):
        """The type of a node of the C interface."""
        new = cls()
        parts = ("id", "number_of_elements", "offset", "stride", "element_bytes", "endianness")
        numbers = (called("catalyst_conduit_datatype_" + part, address) for part in parts)
        new._id, new._elements, new._offset, new._stride, new._element_bytes, new._endianness = numbers
        return new

    def _parts(self):
        return (self._id, self._elements, self._offset, self._stride, self._element_bytes, self._endianness)

    # ---- Setting.
    def set(
        self,
        dtype_id=None,
        num_elements=0,
        offset=0,
        stride=None,
        element_bytes=None,
        endianness=0,
        dtype_name=None,
    ):
        """Sets all at once, the type by its number or its name; or takes over another `DataType`."""
        if isinstance(dtype_id, DataType):
            self.__init__(dtype_id)
            return
        if dtype_id is None and dtype_name is None:
            raise TypeError("DataType.set takes dtype_id or dtype_name")
        number = self.name_to_id(dtype_name) if dtype_id is None else dtype_id
        name = self.id_to_name(number)
        width = _BYTES[_NAMES.index(name)]
        self._id = number
        self._elements = int(num_elements)
        self._offset = int(offset)
        self._element_bytes = width if element_bytes is None else int(element_bytes)
        self._stride = self._element_bytes if stride is None else int(stride)
        self._endianness = int(endianness)

    def set_id(self, number):
        """Sets the number of the type."""
        self.id_to_name(number)
        self._id = number

    def set_number_of_elements(self, elements):
        """Sets how many elements there are."""
        self._elements = int(elements)

    def set_offset(self, offset):
        """Sets the bytes before the first element."""
        self._offset = int(offset)

    def set_stride(self, stride):
        """Sets the bytes from an element to the next."""
        self._stride = int(stride)

    def set_element_bytes(self, element_bytes):
        """Sets the bytes of an element."""
        self._element_bytes = int(element_bytes)

    def set_endianness(self, endianness):
        """Sets the order of bytes: 0 the machine's, 1 big, 2 little."""
        self._endianness = int(endianness)

    # ---- Asking.
    def id(self):
        """The number of the type."""
        return self._id

    def name(self):
        """The name of the type."""
        return self.id_to_name(self._id)

    def number_of_elements(self):
        """How many elements there are."""
        return self._elements

    def offset(self):
        """The bytes before the first element."""
        return self._offset

    def stride(self):
        """The bytes from an element to the next."""
        return self._stride

    def element_bytes(self):
        """The bytes of an element."""
        return self._element_bytes

    def endianness(self):
        """The order of bytes: 0 the machine's, 1 big, 2 little."""
        return self._endianness

    def element_index(self, element):
        """The bytes before an element."""
        return self._offset + self._stride * element

    def strided_bytes(self):
        """The bytes from the first element to the end of the last."""
        return self._stride * (self._elements - 1) + self._element_bytes if self._elements > 0 else 0

    def spanned_bytes(self):
        """The bytes from where the layout begins to the end of the last element."""
        return self._offset + self.strided_bytes()

    def bytes_compact(self):
        """The bytes of the elements alone."""
        return self._element_bytes * self._elements

    def is_compact(self):
        """Whether nothing lies before or between the elements."""
        return self.spanned_bytes() == self.bytes_compact()

    def compatible(self, other):
        """Whether what is of this type has room for what is of another."""
        if self._id <= DataType.list_id():
            return self._id == other._id
        return (
            self._id == other._id
            and self._element_bytes == other._element_bytes
            and self._elements >= other._elements
        )

    def equals(self, other):
        """Whether type and layout are the same."""
        return self._parts() == other._parts()

    def is_number(self):
        """Whether this is a type of numbers."""
        return self.name() in TYPES

    def is_floating_point(self):
        """Whether this is a type of real numbers."""
        return self.name().startswith("float")

    def is_integer(self):
        """Whether this is a type of whole numbers."""
        return self.is_signed_integer() or self.is_unsigned_integer()

    def is_signed_integer(self):
        """Whether this is a type of whole numbers with a sign."""
        return self.name().startswith("int")

    def is_unsigned_integer(self):
        """Whether this is a type of whole numbers without a sign."""
        return self.name().startswith("uint")

    def is_string(self):
        """Whether this is a text."""
        return self.name() == "char8_str"

    def is_little_endian(self):
        """Whether the least byte comes first."""
        return self._order() == "little"

    def is_big_endian(self):
        """Whether the greatest byte comes first."""
        return self._order() == "big"

    def endianness_matches_machine(self):
        """Whether bytes come in the order of this machine."""
        return self._order() == sys.byteorder

    def _order(self):
        return sys.byteorder if self._endianness == 0 else _ORDERS[self._endianness]

    # ---- Texts.
    def _entries(self):
        """The name and value of each part, as a schema has them."""
        entries = [("dtype", f'"{self.name()}"')]
        if self._id > DataType.list_id():
            entries += [
                ("number_of_elements", self._elements),
                ("offset", self._offset),
                ("stride", self._stride),
                ("element_bytes", self._element_bytes),
                ("endianness", f'"{self._order()}"'),
            ]
        return entries

    def to_json(self):
        """The type as JSON, as a schema has it."""
        return "{" + ", ".join(f'"{name}": {value}' for name, value in self._entries()) + "}"

    def to_yaml(self):
        """The type as YAML."""
        return "".join(f"{name}: {value}\n" for name, value in self._entries())

    def to_string(self, protocol="yaml"):
        """The type as a text of a protocol, "yaml" or "json"."""
        writers = {"yaml": self.to_yaml, "json": self.to_json}
        if protocol not in writers:
            raise ValueError(f"DataType.to_string takes {' or '.join(writers)}, not {protocol!r}")
        return writers[protocol]()

    __str__ = __repr__ = to_json

    # ---- Numbers and names of types.
    @staticmethod
    def id_to_name(number):
        """The name of a type's number."""
        if not 0 <= number < len(_NAMES):
            raise ValueError(f"there is no type {number}; types have the numbers 0 to {len(_NAMES) - 1}")
        return _NAMES[number]

    @staticmethod
    def name_to_id(name):
        """The number of a type's name."""
        if name not in _NAMES:
            raise ValueError(f"there is no type {name!r}; there are {', '.join(_NAMES)}")
        return _NAMES.index(name)


def _add_types():
    """For each type what makes one, its number, and whether another is of it."""

    def made(number):
        def make(num_elements=1, offset=0, stride=None, element_bytes=None, endianness=0):
            new = DataType()
            new.set(number, num_elements, offset, stride, element_bytes, endianness)
            return new

        return make

    def bare(number):
        def make():
            new = DataType()
            new.set_id(number)
            return new

        return make

    for name in _NAMES + list(_C_TYPES):
        number = _NAMES.index(_C_TYPES.get(name, name))
        plain = name[2:] if name.startswith("c_") else name
        make = made(number) if number > _NAMES.index("list") else bare(number)
        make.__doc__ = f"A `DataType` of {_NAMES[number]}."
        setattr(DataType, name, staticmethod(make))
        setattr(DataType, plain + "_id", staticmethod(lambda number=number: number))
        setattr(DataType, "is_" + plain, lambda self, number=number: self._id == number)


_add_types()
