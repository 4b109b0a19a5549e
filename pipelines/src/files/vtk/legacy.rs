//! VTK's legacy files (.vtk): unstructured grids and polygonal data, text and binary, file versions
//! 1 to 5.

use tombolo_deform::mesh::NumberType;

use super::super::MeshFile;
use super::super::error::{Flaw, Problem};
use super::super::scanner::Scanner;
use super::array::{Array, Numbers, Stored, from_legacy, read_text};
use super::dataset::{Dataset, points, push_cell, push_polyhedron, row};
use super::kind::Kind;
use super::names::decoded;

/// Reads a .vtk file.
pub(in super::super) fn parse(bytes: &[u8]) -> Result<MeshFile, Flaw> {
    let mut scanner = Scanner::new(bytes);
    let first = scanner.line();
    if !first.starts_with(b"# vtk DataFile Version") {
        return Err(scanner.flaw_at(0, Problem::unexpected(first, "# vtk DataFile Version")));
    }
    scanner.line();
    let kind = scanner.word().to_ascii_uppercase();
    scanner.binary = match kind.as_slice() {
        b"ASCII" => false,
        b"BINARY" => true,
        other => return Err(scanner.flaw(Problem::unexpected(other, "ASCII or BINARY"))),
    };
    let mut legacy = Legacy {
        scanner,
        dataset: Dataset::default(),
        rows: Vec::new(),
        types: Vec::new(),
        unstructured: false,
    };
    legacy.sections()?;
    legacy.cells()?;
    legacy.dataset.into_mesh_file()
}

/// The numbers of cells in files before version 5.
const INT: Stored = Stored::Number(NumberType::I32);

/// The owner of attributes.
#[derive(Clone, Copy)]
enum Owner {
    Dataset,
    Points(usize),
    Cells(usize),
}

struct Legacy<'a> {
    scanner: Scanner<'a>,
    dataset: Dataset,
    /// The cells before their types are known, by the section they stand in; `None` in an
    /// unstructured grid.
    rows: Vec<(Option<Kind>, Vec<i64>)>,
    types: Vec<i64>,
    unstructured: bool,
}

impl Legacy<'_> {
    fn sections(&mut self) -> Result<(), Flaw> {
        let mut owner = Owner::Dataset;
        loop {
            let start = self.scanner.position();
            let word = self.scanner.word();
            if word.is_empty() {
                return Ok(());
            }
            match word.to_ascii_uppercase().as_slice() {
                b"DATASET" => self.dataset_kind()?,
                b"METADATA" => self.skip_metadata(),
                b"FIELD" => self.field(owner)?,
                b"POINTS" => {
                    let count: u64 = self.scanner.number("the number of points")?;
                    let kind = self.scalar()?;
                    let numbers =
                        self.numbers(kind, count.saturating_mul(3), "point coordinates")?;
                    let (name, number) = ("points".into(), kind.number());
                    let array = Array { name, components: 3, number, numbers };
                    self.dataset.points =
                        points(array).map_err(|problem| self.scanner.flaw(problem))?;
                }
                b"CELLS" => self.rows(None)?,
                b"VERTICES" => self.rows(Some(Kind::Vertices))?,
                b"LINES" => self.rows(Some(Kind::Lines))?,
                b"POLYGONS" => self.rows(Some(Kind::Polygons))?,
                b"TRIANGLE_STRIPS" => self.rows(Some(Kind::Strips))?,
                b"CELL_TYPES" => {
                    let count: u64 = self.scanner.number("the number of cell types")?;
                    self.types = self.integers(INT, count, "cell types")?;
                }
                b"POINT_DATA" => {
                    self.scanner.number::<u64>("the number of points")?;
                    owner = Owner::Points(self.dataset.points.len());
                }
                b"CELL_DATA" => {
                    self.scanner.number::<u64>("the number of cells")?;
                    owner = Owner::Cells(self.rows.len());
                }
                attribute => {
                    if !self.attribute(attribute, owner)? {
                        return Err(self
                            .scanner
                            .flaw_at(start, Problem::unexpected(word, "a keyword of the format")));
                    }
                }
            }
        }
    }

    fn dataset_kind(&mut self) -> Result<(), Flaw> {
        let kind = self.scanner.word();
        self.unstructured = match kind.to_ascii_uppercase().as_slice() {
            b"UNSTRUCTURED_GRID" => true,
            b"POLYDATA" => false,
            other => {
                return Err(self.scanner.flaw(Problem::Unsupported {
                    what: format!("a VTK dataset of type {}", String::from_utf8_lossy(other)),
                    instead: "write it as an unstructured grid or polygonal data",
                }));
            }
        };
        Ok(())
    }

    fn skip_metadata(&mut self) {
        self.scanner.line();
        while !self.scanner.rest().is_empty() && !self.scanner.line().trim_ascii().is_empty() {}
    }

    fn scalar(&mut self) -> Result<Stored, Flaw> {
        let start = self.scanner.position();
        let name = self.scanner.text("a number type")?;
        from_legacy(name).ok_or_else(|| {
            self.scanner
                .flaw_at(start, Problem::unexpected(name.as_bytes(), "a number type of VTK"))
        })
    }

    /// So many numbers from the next line on.
    fn numbers(&mut self, kind: Stored, count: u64, what: &str) -> Result<Numbers, Flaw> {
        if self.scanner.binary {
            self.scanner.line();
            if let Stored::Number(number) = kind {
                self.scanner.check_count(count, number.bytes(), what)?;
            }
            let bytes = self.scanner.take(kind.bytes(count), what)?;
            return Ok(kind.decode(bytes, true, Some(count)));
        }
        let count = self.scanner.check_count(count, 2, what)?;
        read_text(kind.number(), &mut self.scanner, Some(count))
    }

    fn integers(&mut self, kind: Stored, count: u64, what: &str) -> Result<Vec<i64>, Flaw> {
        match self.numbers(kind, count, what)? {
            Numbers::Integer(values) => Ok(values),
            _ => Err(self
                .scanner
                .flaw(Problem::unexpected(b"other numbers", format!("integers for {what}")))),
        }
    }

    /// Cells: each with its count in front, or (from file version 5 on) as offsets and
    /// connectivity.
    fn rows(&mut self, kind: Option<Kind>) -> Result<(), Flaw> {
        let first: u64 = self.scanner.number("the number of cells")?;
        let size: u64 = self.scanner.number("the size of the cells")?;
        let in_new_form = self.scanner.peek_word().eq_ignore_ascii_case(b"OFFSETS");
        if in_new_form {
            self.scanner.word();
            let number = self.scalar()?;
            let offsets = self.integers(number, first, "offsets of cells")?;
            let word = self.scanner.word();
            if !word.eq_ignore_ascii_case(b"CONNECTIVITY") {
                return Err(self.scanner.flaw(Problem::unexpected(word, "CONNECTIVITY")));
            }
            let number = self.scalar()?;
            let connectivity = self.integers(number, size, "connectivity")?;
            let mut last = 0;
            for (cell, pair) in offsets.windows(2).enumerate() {
                let &[start, end] = pair else { continue };
                let vertices = row(&connectivity, cell, start, end)
                    .map_err(|problem| self.scanner.flaw(problem))?;
                if start != last {
                    let (found, expected) = (start.cast_unsigned(), last.cast_unsigned());
                    return Err(self.scanner.flaw(Problem::Count {
                        what: "start of a cell".into(),
                        found,
                        expected,
                    }));
                }
                last = end;
                self.rows.push((kind, vertices.to_vec()));
            }
            return Ok(());
        }
        let numbers = self.integers(INT, size, "cells")?;
        let mut start = 0;
        for cell in 0..first {
            let cell = usize::try_from(cell).unwrap_or(usize::MAX);
            let count = row(&numbers, cell, start, start + 1)
                .map_err(|problem| self.scanner.flaw(problem))?;
            let end = count.first().and_then(|&count| (start + 1).checked_add(count)).unwrap_or(-1);
            let vertices = row(&numbers, cell, start + 1, end)
                .map_err(|problem| self.scanner.flaw(problem))?;
            self.rows.push((kind, vertices.to_vec()));
            start = end;
        }
        Ok(())
    }

    /// Cells from their rows and types.
    fn cells(&mut self) -> Result<(), Flaw> {
        if self.unstructured {
            Problem::check_count("cell types", self.types.len(), self.rows.len())
                .map_err(|it| self.scanner.flaw(it))?;
        }
        if !self.unstructured {
            // VTK numbers the cells of polygonal data by kind, whatever the order of the file.
            self.rows.sort_by_key(|(kind, _)| *kind);
        }
        let cells = &mut self.dataset.cells;
        for (cell, (kind, vertices)) in self.rows.iter().enumerate() {
            let cell_type = match kind {
                Some(kind) => kind.cell_type(vertices.len()),
                None => self.types.get(cell).copied().unwrap_or(0),
            };
            if cell_type == 42 {
                push_polyhedron(cells, vertices)?
            } else {
                push_cell(cells, cell_type, vertices)?
            }
        }
        Ok(())
    }

    /// One attribute; false where the word starts none.
    fn attribute(&mut self, word: &[u8], owner: Owner) -> Result<bool, Flaw> {
        let tuples = match owner {
            Owner::Points(count) | Owner::Cells(count) => count as u64,
            Owner::Dataset => return Ok(false),
        };
        let name = decoded(self.scanner.text("the name of an array")?);
        let (components, kind) = match word {
            b"SCALARS" => {
                let kind = self.scalar()?;
                let mut components = 1;
                if !self.scanner.peek_word().eq_ignore_ascii_case(b"LOOKUP_TABLE") {
                    components = self.scanner.number("a number of components")?;
                }
                if self.scanner.peek_word().eq_ignore_ascii_case(b"LOOKUP_TABLE") {
                    self.scanner.word();
                    self.scanner.word();
                }
                (components, kind)
            }
            b"VECTORS" | b"NORMALS" => (3, self.scalar()?),
            b"TENSORS" => (9, self.scalar()?),
            b"TENSORS6" => (6, self.scalar()?),
            b"GLOBAL_IDS" | b"PEDIGREE_IDS" | b"EDGE_FLAGS" => (1, self.scalar()?),
            b"TEXTURE_COORDINATES" => {
                (self.scanner.number("a number of components")?, self.scalar()?)
            }
            // Colours are bytes in binary files, numbers from 0 to 1 in text files.
            b"COLOR_SCALARS" => (self.scanner.number("a number of components")?, self.colour()),
            b"LOOKUP_TABLE" => {
                let size: u64 = self.scanner.number("the size of a lookup table")?;
                self.numbers(self.colour(), size.saturating_mul(4), "colours of a lookup table")?;
                return Ok(true);
            }
            _ => return Ok(false),
        };
        let mut numbers = self.numbers(kind, tuples.saturating_mul(components), &name)?;
        let mut number = kind.number();
        if word == b"COLOR_SCALARS" && !self.scanner.binary {
            (number, numbers) = (NumberType::U8, bytes_of_colours(numbers));
        }
        let components = usize::try_from(components).unwrap_or(usize::MAX);
        self.push(owner, Array { name, components, number, numbers });
        Ok(true)
    }

    fn colour(&self) -> Stored {
        Stored::Number(if self.scanner.binary { NumberType::U8 } else { NumberType::F64 })
    }

    /// A list of arrays.
    fn field(&mut self, owner: Owner) -> Result<(), Flaw> {
        self.scanner.word();
        let count: u64 = self.scanner.number("a number of arrays")?;
        for _ in 0..count {
            // An array that is not there is written as its name alone: NULL_ARRAY.
            while self.scanner.peek_word() == b"METADATA" {
                self.skip_metadata();
            }
            let name = decoded(self.scanner.text("the name of an array")?);
            if name == "NULL_ARRAY" {
                continue;
            }
            let components: u64 = self.scanner.number("a number of components")?;
            let tuples: u64 = self.scanner.number("a number of tuples")?;
            let values = components.saturating_mul(tuples);
            let is_text = matches!(self.scanner.peek_word(), b"string" | b"utf8_string");
            let (number, numbers) = if is_text {
                self.scanner.word();
                self.scanner.line();
                (NumberType::default(), Numbers::Text(self.strings(values)?))
            } else {
                let kind = self.scalar()?;
                (kind.number(), self.numbers(kind, values, &name)?)
            };
            let components = usize::try_from(components).unwrap_or(usize::MAX);
            self.push(owner, Array { name, components, number, numbers });
        }
        Ok(())
    }

    fn strings(&mut self, count: u64) -> Result<Vec<String>, Flaw> {
        let mut strings = Vec::new();
        for _ in 0..self.scanner.check_count(count, 1, "strings")? {
            if !self.scanner.binary {
                strings.push(decoded(&String::from_utf8_lossy(self.scanner.line())));
                continue;
            }
            // The two highest bits of the first byte say how many bytes make the length.
            let first = self.scanner.rest().first().copied().unwrap_or(0);
            let width = [8, 4, 2, 1].get(usize::from(first >> 6)).copied().unwrap_or(1);
            let bytes = self.scanner.take(width, "the length of a string")?;
            let all = bytes.iter().fold(0, |length: u64, &byte| (length << 8) | u64::from(byte));
            let length = if width == 8 { all } else { all & ((1 << (8 * width - 2)) - 1) };
            let text = self.scanner.take(length, "a string")?;
            strings.push(String::from_utf8_lossy(text).into_owned());
        }
        Ok(strings)
    }

    fn push(&mut self, owner: Owner, array: Array) {
        match owner {
            Owner::Dataset => self.dataset.field_arrays.push(array),
            Owner::Points(_) => self.dataset.point_arrays.push(array),
            Owner::Cells(_) => self.dataset.cell_arrays.push(array),
        }
    }
}

/// Colours from 0 to 1 as the bytes that VTK makes of them.
fn bytes_of_colours(numbers: Numbers) -> Numbers {
    let Numbers::Float(parts) = numbers else { return numbers };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whatever is out of range is the nearest byte"
    )]
    let byte = |part: f64| (255.0 * part + 0.5) as u8;
    Numbers::Integer(parts.into_iter().map(|part| byte(part).into()).collect())
}
