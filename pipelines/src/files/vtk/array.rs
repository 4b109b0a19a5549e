//! Arrays of VTK files: any number type, or text.

use tombolo_deform::mesh::NumberType;

use super::super::error::Problem;
use super::super::scanner::Scanner;

/// A number type of VTK, by its width in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    Signed(usize),
    Unsigned(usize),
    Float(usize),
}

impl Scalar {
    /// The type that XML files call so.
    pub fn from_xml(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Scalar::Signed(1),
            "Int16" => Scalar::Signed(2),
            "Int32" => Scalar::Signed(4),
            "Int64" => Scalar::Signed(8),
            "UInt8" => Scalar::Unsigned(1),
            "UInt16" => Scalar::Unsigned(2),
            "UInt32" => Scalar::Unsigned(4),
            "UInt64" => Scalar::Unsigned(8),
            "Float32" => Scalar::Float(4),
            "Float64" => Scalar::Float(8),
            _ => return None,
        })
    }

    /// The type that legacy files call so.
    pub fn from_legacy(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "char" | "signed_char" => Scalar::Signed(1),
            "unsigned_char" => Scalar::Unsigned(1),
            "short" => Scalar::Signed(2),
            "unsigned_short" => Scalar::Unsigned(2),
            // Legacy files store VTK's identifiers as 32-bit numbers.
            "int" | "vtkidtype" => Scalar::Signed(4),
            "unsigned_int" => Scalar::Unsigned(4),
            "long" | "vtktypeint64" | "long_long" => Scalar::Signed(8),
            "unsigned_long" | "vtktypeuint64" | "unsigned_long_long" => Scalar::Unsigned(8),
            "float" => Scalar::Float(4),
            "double" => Scalar::Float(8),
            _ => return None,
        })
    }

    /// The type that fields of it have.
    pub fn number(self) -> NumberType {
        match self {
            Scalar::Signed(1) => NumberType::I8,
            Scalar::Signed(2) => NumberType::I16,
            Scalar::Signed(4) => NumberType::I32,
            Scalar::Signed(_) => NumberType::I64,
            Scalar::Unsigned(1) => NumberType::U8,
            Scalar::Unsigned(2) => NumberType::U16,
            Scalar::Unsigned(4) => NumberType::U32,
            Scalar::Unsigned(_) => NumberType::U64,
            Scalar::Float(4) => NumberType::F32,
            Scalar::Float(_) => NumberType::F64,
        }
    }

    pub fn width(self) -> usize {
        match self {
            Scalar::Signed(width) | Scalar::Unsigned(width) | Scalar::Float(width) => width,
        }
    }

    /// Numbers from their bytes; bytes beyond the last whole number are not looked at.
    pub fn decode(self, bytes: &[u8], big_endian: bool) -> Result<Numbers, Problem> {
        let chunks = bytes.chunks_exact(self.width()).map(|chunk| {
            let mut word = [0; 8];
            for (index, &byte) in chunk.iter().enumerate() {
                let place = if big_endian { chunk.len() - 1 - index } else { index };
                if let Some(slot) = word.get_mut(place) {
                    *slot = byte;
                }
            }
            u64::from_le_bytes(word)
        });
        Ok(match self {
            #[expect(clippy::cast_possible_truncation, reason = "the word holds 4 bytes")]
            Scalar::Float(4) => {
                Numbers::Float(chunks.map(|word| f64::from(f32::from_bits(word as u32))).collect())
            }
            Scalar::Float(_) => Numbers::Float(chunks.map(f64::from_bits).collect()),
            Scalar::Signed(width) => {
                let unused = 64 - 8 * width;
                Numbers::Integer(
                    chunks.map(|word| (word << unused).cast_signed() >> unused).collect(),
                )
            }
            Scalar::Unsigned(_) => {
                let values: Result<Vec<i64>, Problem> = chunks
                    .map(|word| {
                        i64::try_from(word).map_err(|_| {
                            Problem::unexpected(
                                word.to_string().as_bytes(),
                                format!("a number up to {}", i64::MAX),
                            )
                        })
                    })
                    .collect();
                Numbers::Integer(values?)
            }
        })
    }

    /// Numbers from text: all words of it, or the first `count`.
    pub fn read_text(
        self,
        scanner: &mut Scanner,
        count: Option<usize>,
    ) -> Result<Numbers, super::super::error::Flaw> {
        let count = count.unwrap_or(usize::MAX);
        let more = |scanner: &Scanner, done: usize| {
            done < count && (count < usize::MAX || !scanner.peek_word().is_empty())
        };
        Ok(match self {
            Scalar::Float(_) => {
                let mut values: Vec<f64> = Vec::new();
                while more(scanner, values.len()) {
                    values.push(scanner.number("a number")?);
                }
                Numbers::Float(values)
            }
            Scalar::Signed(_) | Scalar::Unsigned(_) => {
                let mut values: Vec<i64> = Vec::new();
                while more(scanner, values.len()) {
                    values.push(scanner.number("an integer")?);
                }
                Numbers::Integer(values)
            }
        })
    }
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
