//! Arrays of VTK files: any number type, or text.

use std::str::FromStr;

use tombolo_deform::mesh::NumberType;

use super::super::error::{Flaw, Problem};
use super::super::scanner::Scanner;

/// The name of a type of number in VTK.
pub(super) fn number_name(number: NumberType) -> &'static str {
    match number {
        NumberType::I8 => "Int8",
        NumberType::I16 => "Int16",
        NumberType::I32 => "Int32",
        NumberType::I64 => "Int64",
        NumberType::U8 => "UInt8",
        NumberType::U16 => "UInt16",
        NumberType::U32 => "UInt32",
        NumberType::U64 => "UInt64",
        NumberType::F32 => "Float32",
        NumberType::F64 => "Float64",
    }
}

/// How the values of an array are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stored {
    Number(NumberType),
    /// Eight to a byte, the highest bit first.
    Bit,
}

impl Stored {
    /// The type of number that the values have for us.
    pub fn number(self) -> NumberType {
        match self {
            Stored::Number(number) => number,
            Stored::Bit => NumberType::U8,
        }
    }

    /// The bytes of so many values.
    pub fn bytes(self, count: u64) -> u64 {
        match self {
            Stored::Number(number) => count.saturating_mul(number.bytes() as u64),
            Stored::Bit => count.div_ceil(8),
        }
    }

    /// The values from their bytes; of bits the first `count`, and none where that is not known, so that
    /// no more memory is taken than the file warrants. Bytes beyond the last whole number are not
    /// looked at.
    pub fn decode(self, bytes: &[u8], big_endian: bool, count: Option<u64>) -> Numbers {
        let number = match self {
            Stored::Number(number) => number,
            Stored::Bit => {
                let count = usize::try_from(count.unwrap_or(0)).unwrap_or(usize::MAX);
                let bits = bytes.iter().flat_map(|byte| (0..8).map(move |bit| byte << bit >> 7));
                return Numbers::Integer(bits.take(count).map(i64::from).collect());
            }
        };
        decode(number, bytes, big_endian)
    }
}

/// How the values are stored of arrays that XML files call so.
pub(super) fn from_xml(name: &str) -> Option<Stored> {
    if name == "Bit" {
        return Some(Stored::Bit);
    }
    let mut all = NumberType::ALL.into_iter();
    all.find(|number| number_name(*number) == name).map(Stored::Number)
}

/// How the values are stored of arrays that legacy files call so.
pub(super) fn from_legacy(name: &str) -> Option<Stored> {
    Some(Stored::Number(match name.to_ascii_lowercase().as_str() {
        "bit" => return Some(Stored::Bit),
        "char" | "signed_char" => NumberType::I8,
        "unsigned_char" => NumberType::U8,
        "short" => NumberType::I16,
        "unsigned_short" => NumberType::U16,
        // Legacy files store VTK's identifiers as 32-bit numbers.
        "int" | "vtkidtype" => NumberType::I32,
        "unsigned_int" => NumberType::U32,
        "long" | "vtktypeint64" | "long_long" => NumberType::I64,
        "unsigned_long" | "vtktypeuint64" | "unsigned_long_long" => NumberType::U64,
        "float" => NumberType::F32,
        "double" => NumberType::F64,
        _ => return None,
    }))
}

fn decode(kind: NumberType, bytes: &[u8], big_endian: bool) -> Numbers {
    fn all<const N: usize, T>(
        bytes: &[u8],
        big_endian: bool,
        number: impl Fn([u8; N]) -> T,
    ) -> Vec<T> {
        let in_order = |mut word: [u8; N]| {
            if big_endian {
                word.reverse();
            }
            number(word)
        };
        bytes.as_chunks().0.iter().copied().map(in_order).collect()
    }
    match kind {
        NumberType::I8 => {
            Numbers::Integer(all(bytes, big_endian, |word| i8::from_le_bytes(word).into()))
        }
        NumberType::I16 => {
            Numbers::Integer(all(bytes, big_endian, |word| i16::from_le_bytes(word).into()))
        }
        NumberType::I32 => {
            Numbers::Integer(all(bytes, big_endian, |word| i32::from_le_bytes(word).into()))
        }
        NumberType::I64 => Numbers::Integer(all(bytes, big_endian, i64::from_le_bytes)),
        NumberType::U8 => {
            Numbers::Integer(all(bytes, big_endian, |word| u8::from_le_bytes(word).into()))
        }
        NumberType::U16 => {
            Numbers::Integer(all(bytes, big_endian, |word| u16::from_le_bytes(word).into()))
        }
        NumberType::U32 => {
            Numbers::Integer(all(bytes, big_endian, |word| u32::from_le_bytes(word).into()))
        }
        NumberType::U64 => wide(all(bytes, big_endian, |word| u64::from_le_bytes(word).into())),
        NumberType::F32 => {
            Numbers::Float(all(bytes, big_endian, |word| f32::from_le_bytes(word).into()))
        }
        NumberType::F64 => Numbers::Float(all(bytes, big_endian, f64::from_le_bytes)),
    }
}

/// Numbers that may be beyond those of 64 bits with a sign: then as doubles, which a field holds.
fn wide(values: Vec<i128>) -> Numbers {
    let narrow = values.iter().map(|value| i64::try_from(*value).ok());
    #[expect(
        clippy::cast_precision_loss,
        reason = "fields of large integers are shown, not computed with"
    )]
    let as_doubles = || Numbers::Float(values.iter().map(|value| *value as f64).collect());
    narrow.collect::<Option<_>>().map_or_else(as_doubles, Numbers::Integer)
}

/// Numbers from text: all words of it, or the first `count`.
pub(super) fn read_text(
    kind: NumberType,
    scanner: &mut Scanner,
    count: Option<usize>,
) -> Result<Numbers, Flaw> {
    fn all<T: FromStr>(
        scanner: &mut Scanner,
        count: Option<usize>,
        expected: &str,
    ) -> Result<Vec<T>, Flaw> {
        let mut values = Vec::new();
        while count.map_or(!scanner.peek_word().is_empty(), |count| values.len() < count) {
            values.push(scanner.number(expected)?);
        }
        Ok(values)
    }
    if kind.is_real() {
        return Ok(Numbers::Float(all(scanner, count, "a number")?));
    }
    if kind == NumberType::U64 {
        return Ok(wide(all(scanner, count, "an integer")?));
    }
    Ok(Numbers::Integer(all(scanner, count, "an integer")?))
}

/// The values of an array.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Numbers {
    Float(Vec<f64>),
    Integer(Vec<i64>),
    Text(Vec<String>),
}

impl Numbers {
    pub fn len(&self) -> usize {
        match self {
            Numbers::Float(values) => values.len(),
            Numbers::Integer(values) => values.len(),
            Numbers::Text(values) => values.len(),
        }
    }
}

/// A named array.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    pub name: String,
    pub components: usize,
    /// The type that the file says; of no meaning for text.
    pub number: NumberType,
    pub numbers: Numbers,
}

impl Array {
    /// The values as double precision; nothing for text.
    pub fn into_floats(self) -> Option<Vec<f64>> {
        match self.numbers {
            Numbers::Float(values) => Some(values),
            #[expect(
                clippy::cast_precision_loss,
                reason = "fields of large integers are shown, not computed with"
            )]
            Numbers::Integer(values) => {
                Some(values.into_iter().map(|value| value as f64).collect())
            }
            Numbers::Text(_) => None,
        }
    }

    /// The values as integers, where they all are.
    pub fn integers(&self) -> Result<Vec<i64>, Problem> {
        let whole = |value: f64| -> Result<i64, Problem> {
            // Beyond 2^53 a double does not tell whole numbers apart.
            if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 {
                #[expect(clippy::cast_possible_truncation, reason = "whole and within 2^53")]
                return Ok(value as i64);
            }
            Err(Problem::unexpected(
                value.to_string().as_bytes(),
                format!("an integer in array '{}'", self.name),
            ))
        };
        match &self.numbers {
            Numbers::Integer(values) => Ok(values.clone()),
            Numbers::Float(values) => values.iter().map(|&value| whole(value)).collect(),
            Numbers::Text(_) => {
                Err(Problem::unexpected(b"text", format!("integers in array '{}'", self.name)))
            }
        }
    }
}
