//! Trees from text: plain JSON and YAML, and schemas that say how data lie in memory.

use crate::datatype::{BIG_ENDIAN, DEFAULT_ENDIANNESS, Datatype, Kind, LITTLE_ENDIAN};
use crate::error::{Error, Result};
use crate::json::{self, Value};
use crate::leaf::described;
use crate::node::{DEEPEST, Node};
use crate::{base64, yaml};

/// How a text describes a tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// Plain JSON.
    Json,
    /// Types, layouts and perhaps values.
    Schema,
    /// A schema, and the data in base64.
    Base64,
    /// Plain YAML.
    Yaml,
}

impl Protocol {
    /// The protocol of a name; no name means a schema.
    ///
    /// # Errors
    /// There is none of that name.
    pub fn from_name(name: &str) -> Result<Self> {
        Ok(match name {
            "json" => Self::Json,
            "" | "conduit_json" => Self::Schema,
            "conduit_base64_json" => Self::Base64,
            "yaml" => Self::Yaml,
            _ => {
                let known = "json, conduit_json, conduit_base64_json and yaml";
                return Err(Error::new(format!(
                    "there is no protocol '{name}'; there are {known}"
                )));
            }
        })
    }
}

/// Builds a tree from a text that holds its own values.
///
/// # Errors
/// The text is not what the protocol says.
pub fn parse(text: &str, protocol: Protocol) -> Result<Node> {
    let mut node = Node::new();
    match protocol {
        Protocol::Json => plain(&json::parse(text)?, &mut node)?,
        Protocol::Yaml => plain(&yaml::parse(text)?, &mut node)?,
        Protocol::Schema => Layout { data: std::ptr::null_mut(), length: None }.read(
            &json::parse(text)?,
            &mut node,
            &mut 0,
        )?,
        Protocol::Base64 => return parse_base64(text),
    }
    Ok(node)
}

/// Builds a tree over data that lie as a schema says; protocols that hold their own values do not look at the data.
///
/// # Safety
/// `data` is null or points to all that the schema describes, for as long as the tree is used.
///
/// # Errors
/// As [`parse`].
pub unsafe fn over(text: &str, protocol: Protocol, data: *mut u8) -> Result<Node> {
    if protocol != Protocol::Schema || data.is_null() {
        return parse(text, protocol);
    }
    let mut node = Node::new();
    Layout { data, length: None }.read(&json::parse(text)?, &mut node, &mut 0)?;
    Ok(node)
}

/// Builds a tree that owns a copy of data that lie as a schema says.
///
/// # Errors
/// The schema reaches beyond the data, or is none.
pub fn within(schema: &str, data: &mut [u8]) -> Result<Node> {
    let mut node = Node::new();
    let length = i64::try_from(data.len()).map_err(|_| Error::new("too much data"))?;
    Layout { data: data.as_mut_ptr(), length: Some(length) }.read(
        &json::parse(schema)?,
        &mut node,
        &mut 0,
    )?;
    node.copy()
}

fn parse_base64(text: &str) -> Result<Node> {
    let value = json::parse(text)?;
    let schema = value.get("schema").ok_or_else(|| Error::new("'schema' is missing"))?;
    let Some(Value::Text(encoded)) = value.get("data").and_then(|data| data.get("base64")) else {
        return Err(Error::new("'data/base64' is missing"));
    };
    let mut data = base64::decode(encoded)?;
    let length = i64::try_from(data.len()).map_err(|_| Error::new("too much data"))?;
    let mut node = Node::new();
    Layout { data: data.as_mut_ptr(), length: Some(length) }.read(schema, &mut node, &mut 0)?;
    node.copy()
}

/// The compact data of a tree, and the schema that finds them.
///
/// # Errors
/// A leaf has no data.
pub fn serialize(node: &Node) -> Result<(String, Vec<u8>)> {
    let compact = node.compacted()?;
    let schema = compact.to_json(&crate::print::Style::default(), crate::print::Detail::Layout);
    let bytes =
        usize::try_from(compact.compact_bytes()).map_err(|_| Error::new("too much data"))?;
    let start = compact.data();
    if bytes == 0 || start.is_null() {
        return Ok((schema, Vec::new()));
    }
    // SAFETY: a compacted tree's root owns one block of that many bytes.
    Ok((schema, unsafe { std::slice::from_raw_parts(start, bytes) }.to_vec()))
}

/// The tree as JSON with its data in base64.
///
/// # Errors
/// As [`serialize`].
pub fn to_base64_json(node: &Node) -> Result<String> {
    let (schema, data) = serialize(node)?;
    Ok(format!(
        "{{\n\"schema\": {schema},\n\"data\": {{\"base64\": \"{}\"}}\n}}\n",
        base64::encode(&data)
    ))
}

/// The child of a name, which a text brings once.
fn new_child<'a>(node: &'a mut Node, name: &str) -> Result<&'a mut Node> {
    if node.get(name).is_some() {
        return Err(Error::new(format!("{}: the name '{name}' is there twice", node.place())));
    }
    node.child_named(name)
}

/// Fills a node with a plain value: numbers become leaves, lists of numbers arrays.
fn plain(value: &Value, node: &mut Node) -> Result<()> {
    match value {
        Value::Null => {
            node.reset();
            Ok(())
        }
        Value::Boolean(value) => node.set_number(u8::from(*value)),
        Value::Integer(value) => node.set_number(*value),
        Value::Unsigned(value) => node.set_number(*value),
        Value::Real(value) => node.set_number(*value),
        Value::Text(text) => node.set_text(text),
        Value::Object(entries) => {
            node.become_tree(Kind::Object);
            entries.iter().try_for_each(|(name, value)| plain(value, new_child(node, name)?))
        }
        Value::List(values) => {
            // JSON has no numbers that are not finite: among numbers they are written as texts.
            let numbers = |value: &Value| match value {
                Value::Integer(_) | Value::Unsigned(_) | Value::Real(_) => true,
                Value::Text(text) => matches!(text.as_str(), "nan" | "inf" | "-inf"),
                _ => false,
            };
            if values.is_empty() || !values.iter().all(numbers) {
                node.become_tree(Kind::List);
                return values.iter().try_for_each(|value| plain(value, node.append()?));
            }
            let integers: Option<Vec<i64>> = values
                .iter()
                .map(|value| if let Value::Integer(value) = value { Some(*value) } else { None })
                .collect();
            match integers {
                Some(integers) => node.set_numbers(&integers),
                None => {
                    node.set_numbers(&values.iter().filter_map(Value::real).collect::<Vec<_>>())
                }
            }
        }
    }
}

/// The data that a schema is laid over.
struct Layout {
    data: *mut u8,
    length: Option<i64>,
}

impl Layout {
    fn read(&self, schema: &Value, node: &mut Node, used: &mut i64) -> Result<()> {
        match schema {
            Value::Text(name) => self.leaf(name, schema, node, used),
            Value::List(entries) => {
                node.become_tree(Kind::List);
                entries.iter().try_for_each(|entry| self.read(entry, node.append()?, used))
            }
            Value::Object(entries) => match schema.get("dtype") {
                Some(Value::Text(name)) => self.leaf(name, schema, node, used),
                Some(inner) => {
                    let count = integer(schema, &["length", "number_of_elements"])?.unwrap_or(1);
                    if !(0..=1 << 24).contains(&count) {
                        return Err(Error::new(format!("a list of {count} is not understood")));
                    }
                    node.become_tree(Kind::List);
                    (0..count).try_for_each(|_| self.read(inner, node.append()?, used))
                }
                None => {
                    if node.depth() > DEEPEST {
                        return Err(Error::new("a schema nested too deeply"));
                    }
                    node.become_tree(Kind::Object);
                    entries.iter().try_for_each(|(name, entry)| {
                        self.read(entry, new_child(node, name)?, used)
                    })
                }
            },
            other => Err(Error::new(format!("a schema holds types, not {other:?}"))),
        }
    }

    fn leaf(&self, name: &str, schema: &Value, node: &mut Node, used: &mut i64) -> Result<()> {
        let kind = Kind::from_name(name)
            .ok_or_else(|| Error::new(format!("there is no type '{name}'")))?;
        match kind {
            Kind::Empty => {
                node.reset();
                return Ok(());
            }
            Kind::Object | Kind::List => {
                node.become_tree(kind);
                return Ok(());
            }
            _ => {}
        }
        let value = schema.get("value");
        let counted = match value {
            Some(Value::List(values)) => i64::try_from(values.len()).unwrap_or(i64::MAX),
            Some(Value::Text(text)) if kind == Kind::Text => {
                i64::try_from(text.len() + 1).unwrap_or(i64::MAX)
            }
            _ => 1,
        };
        let elements = integer(schema, &["number_of_elements", "length"])?.unwrap_or(counted);
        let endianness = match schema.get("endianness") {
            None => DEFAULT_ENDIANNESS,
            Some(Value::Text(order)) if order == "default" => DEFAULT_ENDIANNESS,
            Some(Value::Text(order)) if order == "big" => BIG_ENDIAN,
            Some(Value::Text(order)) if order == "little" => LITTLE_ENDIAN,
            Some(other) => {
                return Err(Error::new(format!("'endianness' is big or little, not {other:?}")));
            }
        };
        let datatype = Datatype {
            kind,
            elements,
            offset: integer(schema, &["offset"])?.unwrap_or(*used),
            stride: integer(schema, &["stride"])?.unwrap_or(kind.bytes()),
            element_bytes: integer(schema, &["element_bytes"])?.unwrap_or(kind.bytes()),
            endianness,
        };
        let datatype = described(kind, self.data.cast_const(), datatype).or_else(|error| {
            if self.data.is_null() {
                described(kind, std::ptr::dangling(), datatype)
            } else {
                Err(error)
            }
        })?;
        let end = datatype.offset.checked_add(datatype.strided_bytes());
        if self.data.is_null() {
            node.make_room(Datatype::compact(kind, elements))?;
        } else {
            let fits = |length: i64| {
                datatype.offset >= 0
                    && datatype.stride >= datatype.element_bytes
                    && end.is_some_and(|end| end <= length)
            };
            if let Some(length) = self.length.filter(|length| !fits(*length)) {
                let message = format!(
                    "{elements} {} at {} reach beyond {length} bytes of data",
                    kind.name(),
                    datatype.offset
                );
                return Err(Error::new(message));
            }
            node.borrow_elements(kind, self.data, datatype)?;
        }
        *used = end.unwrap_or(i64::MAX).max(*used);
        value.map_or(Ok(()), |value| fill(node, value))
    }
}

/// Writes the values of a schema over the elements of a leaf.
fn fill(node: &mut Node, value: &Value) -> Result<()> {
    let mut written = Node::new();
    match (node.kind(), value) {
        (Kind::Text, Value::Text(text)) => written.set_text(text)?,
        (Kind::Text, other) => {
            return Err(Error::new(format!("a text is expected, not {other:?}")));
        }
        (kind, Value::List(values)) => convert(kind, values, &mut written)?,
        (_, Value::Null) => return Ok(()),
        (kind, one) => convert(kind, std::slice::from_ref(one), &mut written)?,
    }
    if written.datatype().elements > node.datatype().elements {
        let (given, room) = (written.datatype().elements, node.datatype().elements);
        return Err(Error::new(format!("{given} values are given for {room} elements")));
    }
    node.write_from(&written)
}

/// Numbers as elements of a type.
#[expect(clippy::cast_possible_truncation, reason = "a float32 is the nearest one")]
fn convert(kind: Kind, values: &[Value], node: &mut Node) -> Result<()> {
    let wrong = |value: &Value| Error::new(format!("{value:?} does not fit into {}", kind.name()));
    macro_rules! integers {
        ($type:ty) => {{
            let one = |value: &Value| match value {
                Value::Unsigned(value) => <$type>::try_from(*value).ok(),
                value => value.integer().and_then(|value| <$type>::try_from(value).ok()),
            };
            let all: Result<Vec<$type>> =
                values.iter().map(|value| one(value).ok_or_else(|| wrong(value))).collect();
            node.set_numbers(&all?)
        }};
    }
    let reals = || {
        values
            .iter()
            .map(|value| value.real().ok_or_else(|| wrong(value)))
            .collect::<Result<Vec<f64>>>()
    };
    match kind {
        Kind::Int8 => integers!(i8),
        Kind::Int16 => integers!(i16),
        Kind::Int32 => integers!(i32),
        Kind::Int64 => integers!(i64),
        Kind::Uint8 => integers!(u8),
        Kind::Uint16 => integers!(u16),
        Kind::Uint32 => integers!(u32),
        Kind::Uint64 => integers!(u64),
        Kind::Float32 => {
            node.set_numbers(&reals()?.into_iter().map(|value| value as f32).collect::<Vec<_>>())
        }
        Kind::Float64 => node.set_numbers(&reals()?),
        Kind::Empty | Kind::Object | Kind::List | Kind::Text => Ok(()),
    }
}

fn integer(schema: &Value, names: &[&str]) -> Result<Option<i64>> {
    for name in names {
        if let Some(value) = schema.get(name) {
            return match value.integer() {
                Some(value) => Ok(Some(value)),
                None => Err(Error::new(format!("'{name}' is an integer, not {value:?}"))),
            };
        }
    }
    Ok(None)
}
