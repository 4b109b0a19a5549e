//! What a node holds: the type of its elements and how they lie in memory.

/// The type of a node, numbered as in Conduit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(i64)]
pub enum Kind {
    /// Nothing.
    Empty = 0,
    /// Children with names.
    Object = 1,
    /// Children without names.
    List = 2,
    /// Signed integers of 8 bits.
    Int8 = 3,
    /// Signed integers of 16 bits.
    Int16 = 4,
    /// Signed integers of 32 bits.
    Int32 = 5,
    /// Signed integers of 64 bits.
    Int64 = 6,
    /// Unsigned integers of 8 bits.
    Uint8 = 7,
    /// Unsigned integers of 16 bits.
    Uint16 = 8,
    /// Unsigned integers of 32 bits.
    Uint32 = 9,
    /// Unsigned integers of 64 bits.
    Uint64 = 10,
    /// Floating point numbers of 32 bits.
    Float32 = 11,
    /// Floating point numbers of 64 bits.
    Float64 = 12,
    /// A text that ends in a nul.
    Text = 13,
}

/// Every type, in the order of their numbers.
pub const KINDS: [Kind; 14] = [
    Kind::Empty,
    Kind::Object,
    Kind::List,
    Kind::Int8,
    Kind::Int16,
    Kind::Int32,
    Kind::Int64,
    Kind::Uint8,
    Kind::Uint16,
    Kind::Uint32,
    Kind::Uint64,
    Kind::Float32,
    Kind::Float64,
    Kind::Text,
];

impl Kind {
    /// The name as schemas write it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Kind::Empty => "empty",
            Kind::Object => "object",
            Kind::List => "list",
            Kind::Int8 => "int8",
            Kind::Int16 => "int16",
            Kind::Int32 => "int32",
            Kind::Int64 => "int64",
            Kind::Uint8 => "uint8",
            Kind::Uint16 => "uint16",
            Kind::Uint32 => "uint32",
            Kind::Uint64 => "uint64",
            Kind::Float32 => "float32",
            Kind::Float64 => "float64",
            Kind::Text => "char8_str",
        }
    }

    /// The type of a name; the names of C types are understood too.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Kind> {
        Some(match name {
            "char" | "signed char" | "signed_char" => Kind::Int8,
            "short" | "signed short" | "signed_short" => Kind::Int16,
            "int" | "signed int" | "signed_int" => Kind::Int32,
            "long" | "signed long" | "signed_long" => Kind::Int64,
            "unsigned char" | "unsigned_char" => Kind::Uint8,
            "unsigned short" | "unsigned_short" => Kind::Uint16,
            "unsigned int" | "unsigned_int" => Kind::Uint32,
            "unsigned long" | "unsigned_long" => Kind::Uint64,
            "float" => Kind::Float32,
            "double" => Kind::Float64,
            "string" => Kind::Text,
            _ => return KINDS.into_iter().find(|kind| kind.name() == name),
        })
    }

    /// Bytes of one element; 0 where there are no elements.
    #[must_use]
    pub fn bytes(self) -> i64 {
        match self {
            Kind::Empty | Kind::Object | Kind::List => 0,
            Kind::Int8 | Kind::Uint8 | Kind::Text => 1,
            Kind::Int16 | Kind::Uint16 => 2,
            Kind::Int32 | Kind::Uint32 | Kind::Float32 => 4,
            Kind::Int64 | Kind::Uint64 | Kind::Float64 => 8,
        }
    }

    /// Whether the elements are signed integers.
    #[must_use]
    pub fn is_signed(self) -> bool {
        matches!(self, Kind::Int8 | Kind::Int16 | Kind::Int32 | Kind::Int64)
    }

    /// Whether the elements are unsigned integers.
    #[must_use]
    pub fn is_unsigned(self) -> bool {
        matches!(self, Kind::Uint8 | Kind::Uint16 | Kind::Uint32 | Kind::Uint64)
    }

    /// Whether the elements are integers.
    #[must_use]
    pub fn is_integer(self) -> bool {
        self.is_signed() || self.is_unsigned()
    }

    /// Whether the elements are floating point numbers.
    #[must_use]
    pub fn is_floating(self) -> bool {
        matches!(self, Kind::Float32 | Kind::Float64)
    }

    /// Whether the elements are numbers.
    #[must_use]
    pub fn is_number(self) -> bool {
        self.is_integer() || self.is_floating()
    }

    /// Whether this is a number or a text, not a tree and not nothing.
    #[must_use]
    pub fn is_leaf(self) -> bool {
        self.bytes() > 0
    }
}

/// The order of the bytes of an element: 0 that of the machine, 1 big, 2 little.
pub const DEFAULT_ENDIANNESS: i64 = 0;
/// The highest byte first.
pub const BIG_ENDIAN: i64 = 1;
/// The lowest byte first.
pub const LITTLE_ENDIAN: i64 = 2;
/// The order of this machine.
pub const MACHINE_ENDIANNESS: i64 =
    if cfg!(target_endian = "big") { BIG_ENDIAN } else { LITTLE_ENDIAN };

/// The type of a node and the layout of its elements; all lengths in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Datatype {
    /// The type.
    pub kind: Kind,
    /// How many elements there are.
    pub elements: i64,
    /// From the start of the data to the first element.
    pub offset: i64,
    /// From one element to the next.
    pub stride: i64,
    /// Bytes of one element.
    pub element_bytes: i64,
    /// The order of the bytes: 0 that of the machine, 1 big, 2 little.
    pub endianness: i64,
}

impl Datatype {
    /// Nothing.
    pub const EMPTY: Datatype = Datatype {
        kind: Kind::Empty,
        elements: 0,
        offset: 0,
        stride: 0,
        element_bytes: 0,
        endianness: DEFAULT_ENDIANNESS,
    };

    /// Elements one after the other, from the start of the data.
    #[must_use]
    pub fn compact(kind: Kind, elements: i64) -> Self {
        let bytes = kind.bytes();
        Self {
            kind,
            elements,
            offset: 0,
            stride: bytes,
            element_bytes: bytes,
            endianness: DEFAULT_ENDIANNESS,
        }
    }

    /// The offset of an element from the start of the data; `None` where the number does not fit.
    #[must_use]
    pub fn element_index(&self, element: i64) -> Option<i64> {
        self.stride.checked_mul(element)?.checked_add(self.offset)
    }

    /// From the first byte of the first element to the last of the last.
    #[must_use]
    pub fn strided_bytes(&self) -> i64 {
        if self.elements <= 0 {
            return 0;
        }
        self.stride.saturating_mul(self.elements - 1).saturating_add(self.element_bytes)
    }

    /// Bytes of the elements without gaps.
    #[must_use]
    pub fn compact_bytes(&self) -> i64 {
        self.kind.bytes().saturating_mul(self.elements.max(0))
    }

    /// Whether there are no gaps.
    #[must_use]
    pub fn is_compact(&self) -> bool {
        !self.kind.is_leaf() || self.elements <= 1 || self.stride == self.element_bytes
    }

    /// Whether what `other` describes fits into what this describes.
    #[must_use]
    pub fn compatible(&self, other: &Datatype) -> bool {
        self.kind == other.kind
            && self.element_bytes == other.element_bytes
            && self.elements >= other.elements
    }

    /// Whether the bytes of an element lie as this machine wants them.
    #[must_use]
    pub fn matches_machine(&self) -> bool {
        self.endianness == DEFAULT_ENDIANNESS || self.endianness == MACHINE_ENDIANNESS
    }
}
