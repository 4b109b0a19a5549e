//! The XML of a VTK file with its arrays appended.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::Write as _;

use tombolo_deform::mesh::NumberType;

use super::super::error::Problem;
use super::array::number_name;

/// How arrays are compressed in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compression {
    /// Not at all: fastest to write.
    #[default]
    None,
    /// zlib, which every VTK reads.
    Zlib,
}

/// The values of an array.
pub(super) enum Values<'a> {
    /// Values of a field, which are written as numbers of this type.
    Numbers(Cow<'a, [f64]>, NumberType),
    Integers(Vec<i64>),
    Bytes(Vec<u8>),
}

/// An array of a file.
pub(super) struct Array<'a> {
    pub name: &'a str,
    pub components: usize,
    pub values: Values<'a>,
}

impl Array<'_> {
    /// How many tuples of components the array has.
    pub fn tuples(&self) -> usize {
        let values = match &self.values {
            Values::Numbers(values, _) => values.len(),
            Values::Integers(values) => values.len(),
            Values::Bytes(values) => values.len(),
        };
        values / self.components.max(1)
    }

    /// Puts the tuples into this order.
    pub fn permute(&mut self, order: &[usize]) {
        pub fn permuted<T: Copy>(values: &[T], components: usize, order: &[usize]) -> Vec<T> {
            let tuple = |&tuple: &usize| {
                values.get(tuple * components..(tuple + 1) * components).unwrap_or(&[])
            };
            order.iter().flat_map(tuple).copied().collect()
        }
        match &mut self.values {
            Values::Numbers(values, _) => {
                *values = Cow::Owned(permuted(values, self.components, order))
            }
            Values::Integers(values) => *values = permuted(values, self.components, order),
            Values::Bytes(values) => *values = permuted(values, self.components, order),
        }
    }
}

/// The values as numbers of a type, which they are.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the values are of the type that they are cast to"
)]
fn number_bytes(values: &[f64], number: NumberType) -> Vec<u8> {
    fn all<const N: usize>(values: &[f64], bytes: impl Fn(f64) -> [u8; N]) -> Vec<u8> {
        values.iter().flat_map(|&value| bytes(value)).collect()
    }
    match number {
        NumberType::I8 => all(values, |value| (value as i8).to_le_bytes()),
        NumberType::I16 => all(values, |value| (value as i16).to_le_bytes()),
        NumberType::I32 => all(values, |value| (value as i32).to_le_bytes()),
        NumberType::I64 => all(values, |value| (value as i64).to_le_bytes()),
        NumberType::U8 => all(values, |value| (value as u8).to_le_bytes()),
        NumberType::U16 => all(values, |value| (value as u16).to_le_bytes()),
        NumberType::U32 => all(values, |value| (value as u32).to_le_bytes()),
        NumberType::U64 => all(values, |value| (value as u64).to_le_bytes()),
        NumberType::F32 => all(values, |value| (value as f32).to_le_bytes()),
        NumberType::F64 => all(values, f64::to_le_bytes),
    }
}

/// A file in the making: its elements, and the data that follow them.
pub(super) struct XmlFile {
    text: String,
    /// The data of each array, with where in the text its offset goes.
    appended: Vec<(usize, Vec<u8>)>,
    compression: Compression,
}

impl XmlFile {
    /// A file without elements so far.
    pub fn new(compression: Compression) -> Self {
        Self { text: String::new(), appended: Vec::new(), compression }
    }

    /// Writes a line of text.
    pub fn line(&mut self, line: std::fmt::Arguments) {
        let _ = writeln!(self.text, "{line}");
    }

    /// Writes an element of arrays.
    pub fn section(&mut self, name: &str, arrays: &[Array]) -> Result<(), Problem> {
        self.line(format_args!("<{name}>"));
        for array in arrays {
            self.array(array, None)?;
        }
        self.line(format_args!("</{name}>"));
        Ok(())
    }

    /// Writes an array; `tuples` where the file must say how many it has.
    pub fn array(&mut self, array: &Array, tuples: Option<usize>) -> Result<(), Problem> {
        let (kind, bytes): (_, Vec<u8>) = match &array.values {
            Values::Numbers(values, number) => {
                (number_name(*number), number_bytes(values, *number))
            }
            Values::Integers(values) => {
                ("Int64", values.iter().flat_map(|value| value.to_le_bytes()).collect())
            }
            Values::Bytes(values) => ("UInt8", values.clone()),
        };
        // Control characters have no place in XML.
        let name: String = array
            .name
            .chars()
            .map(|letter| if letter.is_control() { ' ' } else { letter })
            .collect();
        let name = quick_xml::escape::escape(&name);
        // One component goes without saying: meshio makes columns of arrays that say it.
        let components = match array.components {
            1 => String::new(),
            count => format!(" NumberOfComponents=\"{count}\""),
        };
        let tuples = tuples.map_or(String::new(), |count| format!(" NumberOfTuples=\"{count}\""));
        let _ = write!(
            self.text,
            "<DataArray type=\"{kind}\" Name=\"{name}\"{components}{tuples} format=\"appended\" offset=\""
        );
        let data = match self.compression {
            Compression::None => [&(bytes.len() as u64).to_le_bytes()[..], &bytes].concat(),
            Compression::Zlib => compressed(&bytes)?,
        };
        self.appended.push((self.text.len(), data));
        self.line(format_args!("\"/>"));
        Ok(())
    }

    /// The bytes of the file.
    ///
    /// The data stand in the opposite order of the elements: meshio renumbers the offsets one by
    /// one, and would take an array that it has renumbered for a later one.
    pub fn finish(self) -> Vec<u8> {
        let mut offset = self.appended.iter().map(|(_, data)| data.len()).sum::<usize>();
        let mut bytes = Vec::with_capacity(self.text.len() + offset + 32 * self.appended.len());
        let mut written = 0;
        for (end, data) in &self.appended {
            offset -= data.len();
            bytes.extend(self.text.as_bytes().get(written..*end).unwrap_or(&[]));
            bytes.extend(offset.to_string().as_bytes());
            written = *end;
        }
        bytes.extend(self.text.as_bytes().get(written..).unwrap_or(&[]));
        bytes.extend(b"<AppendedData encoding=\"raw\">\n_");
        self.appended.iter().rev().for_each(|(_, data)| bytes.extend(data));
        bytes.extend(b"\n</AppendedData>\n</VTKFile>\n");
        bytes
    }
}

/// The blocks of an array by zlib, behind the counts that say where each ends.
fn compressed(bytes: &[u8]) -> Result<Vec<u8>, Problem> {
    const BLOCK: usize = 1 << 20;
    let mut packed = Vec::new();
    let mut header =
        vec![bytes.len().div_ceil(BLOCK) as u64, BLOCK as u64, (bytes.len() % BLOCK) as u64];
    for block in bytes.chunks(BLOCK) {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(block)?;
        let block = encoder.finish()?;
        header.push(block.len() as u64);
        packed.extend(block);
    }
    let mut data: Vec<u8> = header.iter().flat_map(|number| number.to_le_bytes()).collect();
    data.extend(packed);
    Ok(data)
}
