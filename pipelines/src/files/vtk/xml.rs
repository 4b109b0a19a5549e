//! VTK's XML files: unstructured grids (.vtu) and polygonal data (.vtp).
//!
//! Text, inline base64 and appended data (raw or base64), either byte order, 32- and 64-bit
//! headers, plain or compressed with zlib or LZ4.

use std::ops::Range;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use tombolo_deform::mesh::{Cells, NumberType};

use super::super::MeshFile;
use super::super::error::{Flaw, Position, Problem};
use super::super::scanner::Scanner;
use super::array::{Array, Numbers, Stored, from_xml, read_text};
use super::dataset::{Dataset, points, push_cell, push_polyhedron, row};
use super::encoding::{Compressor, Encoding, Wrapped};
use super::kind::Kind;

/// Reads a .vtu or .vtp file.
pub(in super::super) fn parse(bytes: &[u8]) -> Result<MeshFile, Flaw> {
    let document = Document::read(bytes)?;
    let mut whole: Option<Dataset> = None;
    for piece in 0..document.pieces.len() {
        let dataset = document.piece(piece)?;
        match &mut whole {
            None => whole = Some(dataset),
            Some(whole) => whole.append(dataset)?,
        }
    }
    let mut whole = whole.ok_or_else(|| Problem::unexpected(b"", "a Piece"))?;
    whole.field_arrays = document.arrays(None, "FieldData", None)?;
    if document.pieces.len() > 1 {
        let count = document.pieces.len();
        whole.notes.push(format!(
            "{count} pieces put together; points on the borders of pieces stay separate"
        ));
    }
    whole.into_mesh_file()
}

/// An array element of the document.
struct Element<'a> {
    name: String,
    /// The piece it belongs to, and the element around it.
    piece: Option<usize>,
    section: String,
    kind: String,
    components: usize,
    form: Form<'a>,
    /// Where it starts in the file.
    position: usize,
}

enum Form<'a> {
    Text(&'a [u8]),
    Base64(&'a [u8]),
    Appended(usize),
}

struct XmlPiece {
    point_count: usize,
    cell_count: Option<usize>,
    /// Those of the document's elements among which its own are: the next piece begins behind them.
    elements: Range<usize>,
}

struct Document<'a> {
    polygonal: bool,
    encoding: Encoding,
    pieces: Vec<XmlPiece>,
    elements: Vec<Element<'a>>,
    appended: Option<Wrapped<'a>>,
}

fn at(position: usize) -> impl Fn(Problem) -> Flaw {
    move |problem| Flaw { position: Position::Byte(position), problem }
}

/// The value of an attribute, if it is there.
fn attribute(element: &BytesStart, name: &str) -> Result<Option<String>, Problem> {
    let broken = |error: &dyn std::fmt::Display| {
        Problem::unexpected(error.to_string().as_bytes(), "an XML attribute")
    };
    let Some(attribute) = element.try_get_attribute(name).map_err(|error| broken(&error))? else {
        return Ok(None);
    };
    let value = attribute.unescape_value().map_err(|error| broken(&error))?;
    Ok(Some(value.into_owned()))
}

/// A number in an attribute, if it is there.
fn count(element: &BytesStart, name: &str) -> Result<Option<usize>, Problem> {
    let Some(value) = attribute(element, name)? else { return Ok(None) };
    let number = value.trim().parse();
    number
        .map(Some)
        .map_err(|_| Problem::unexpected(value.as_bytes(), format!("a number in attribute {name}")))
}

impl<'a> Document<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, Flaw> {
        let mut document = Document {
            polygonal: false,
            encoding: Encoding { big_endian: false, header_width: 4, compressor: Compressor::None },
            pieces: Vec::new(),
            elements: Vec::new(),
            appended: None,
        };
        let mut reader = Reader::from_reader(bytes);
        let mut open: Vec<String> = Vec::new();
        let mut root = false;
        loop {
            let position = usize::try_from(reader.buffer_position()).unwrap_or(bytes.len());
            let event = reader.read_event().map_err(|error| {
                at(position)(Problem::unexpected(error.to_string().as_bytes(), "well-formed XML"))
            })?;
            match event {
                Event::Start(element) => {
                    let name = String::from_utf8_lossy(element.name().as_ref()).into_owned();
                    if !root && name != "VTKFile" {
                        return Err(at(position)(Problem::unexpected(
                            name.as_bytes(),
                            "the element VTKFile",
                        )));
                    }
                    root = true;
                    if name == "AppendedData" {
                        let start =
                            usize::try_from(reader.buffer_position()).unwrap_or(bytes.len());
                        let rest = bytes.get(start..).unwrap_or(&[]);
                        document.appended = Some(appended(&element, rest).map_err(at(position))?);
                        break;
                    }
                    document.start(&element, &name, &open, position).map_err(at(position))?;
                    open.push(name);
                }
                Event::Empty(element) => {
                    let name = String::from_utf8_lossy(element.name().as_ref()).into_owned();
                    document.start(&element, &name, &open, position).map_err(at(position))?;
                }
                Event::End(_) => {
                    open.pop();
                }
                Event::Text(text) => {
                    let parent = open.last().map(String::as_str);
                    if let (Some("DataArray" | "Array"), Some(element)) =
                        (parent, document.elements.last_mut())
                    {
                        let std::borrow::Cow::Borrowed(text) = text.into_inner() else { continue };
                        match &mut element.form {
                            Form::Text(data) | Form::Base64(data)
                                if data.trim_ascii().is_empty() =>
                            {
                                *data = text
                            }
                            _ => {}
                        }
                    }
                }
                Event::Eof if open.is_empty() && root => break,
                Event::Eof => {
                    let expected =
                        open.last().map_or("VTKFile".to_owned(), |name| format!("</{name}>"));
                    return Err(at(position)(Problem::unexpected(
                        b"the end of the file",
                        expected,
                    )));
                }
                _ => {}
            }
        }
        Ok(document)
    }

    fn start(
        &mut self,
        element: &BytesStart,
        name: &str,
        open: &[String],
        position: usize,
    ) -> Result<(), Problem> {
        match name {
            "VTKFile" => self.root(element)?,
            "Piece" => self.pieces.push(XmlPiece {
                point_count: count(element, "NumberOfPoints")?.unwrap_or(0),
                cell_count: count(element, "NumberOfCells")?,
                elements: self.elements.len()..self.elements.len(),
            }),
            "DataArray" | "Array" => {
                let in_piece = open.iter().any(|name| name == "Piece");
                let format = attribute(element, "format")?.unwrap_or_else(|| "ascii".to_owned());
                let form = match format.as_str() {
                    "ascii" => Form::Text(&[]),
                    "binary" => Form::Base64(&[]),
                    "appended" => Form::Appended(count(element, "offset")?.unwrap_or(0)),
                    other => {
                        return Err(Problem::unexpected(
                            other.as_bytes(),
                            "format ascii, binary or appended",
                        ));
                    }
                };
                let components = count(element, "NumberOfComponents")?.unwrap_or(1).max(1);
                self.elements.push(Element {
                    name: attribute(element, "Name")?.unwrap_or_default(),
                    piece: self.pieces.len().checked_sub(1).filter(|_| in_piece),
                    section: open.last().cloned().unwrap_or_default(),
                    kind: attribute(element, "type")?.unwrap_or_default(),
                    components,
                    form,
                    position,
                });
                if let Some(piece) = self.pieces.last_mut() {
                    piece.elements.end = self.elements.len();
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn root(&mut self, element: &BytesStart) -> Result<(), Problem> {
        let kind = attribute(element, "type")?.unwrap_or_default();
        self.polygonal = match kind.as_str() {
            "UnstructuredGrid" => false,
            "PolyData" => true,
            other => {
                return Err(Problem::Unsupported {
                    what: format!("a VTK file of type '{other}'"),
                    instead: "write it as an unstructured grid (.vtu) or polygonal data (.vtp)",
                });
            }
        };
        self.encoding.big_endian =
            attribute(element, "byte_order")?.as_deref() == Some("BigEndian");
        self.encoding.header_width = match attribute(element, "header_type")?.as_deref() {
            Some("UInt64") => 8,
            Some("UInt32") | None => 4,
            Some(other) => {
                return Err(Problem::unexpected(other.as_bytes(), "header_type UInt32 or UInt64"));
            }
        };
        self.encoding.compressor = match attribute(element, "compressor")?.as_deref() {
            None | Some("") => Compressor::None,
            Some("vtkZLibDataCompressor") => Compressor::Zlib,
            Some("vtkLZ4DataCompressor") => Compressor::Lz4,
            Some(other) => {
                return Err(Problem::Unsupported {
                    what: format!("compressor '{other}'"),
                    instead: "write the file uncompressed or with zlib or LZ4",
                });
            }
        };
        Ok(())
    }

    /// The arrays of a section; `tuples` says how many tuples each has, where that is known.
    fn arrays(
        &self,
        piece: Option<usize>,
        section: &str,
        tuples: Option<usize>,
    ) -> Result<Vec<Array>, Flaw> {
        self.elements_of(piece)
            .filter(|element| element.section == section)
            .map(|element| self.array(element, tuples))
            .collect()
    }

    /// The array elements of a piece, or those of none.
    fn elements_of(&self, piece: Option<usize>) -> impl Iterator<Item = &Element<'a>> {
        let range = match piece {
            Some(index) => self.pieces.get(index).map_or(0..0, |piece| piece.elements.clone()),
            None => 0..self.elements.len(),
        };
        let elements = self.elements.get(range).unwrap_or_default();
        elements.iter().filter(move |element| element.piece == piece)
    }

    fn array(&self, element: &Element, tuples: Option<usize>) -> Result<Array, Flaw> {
        let numbers = self.numbers(element, tuples).map_err(at(element.position))?;
        let number = from_xml(&element.kind).map(Stored::number).unwrap_or_default();
        Ok(Array { name: element.name.clone(), components: element.components, number, numbers })
    }

    fn numbers(&self, element: &Element, tuples: Option<usize>) -> Result<Numbers, Problem> {
        // VTK stores text as the codes of its bytes, each string ended by a 0.
        let is_text = element.kind == "String";
        let kind =
            if is_text { Some(Stored::Number(NumberType::U8)) } else { from_xml(&element.kind) };
        let kind = kind.ok_or_else(|| {
            let expected = format!("a number type of VTK for array '{}'", element.name);
            Problem::unexpected(element.kind.as_bytes(), expected)
        })?;
        let wrapped = match element.form {
            Form::Text(text) => {
                let numbers = read_text(kind.number(), &mut Scanner::new(text), None)
                    .map_err(|flaw| flaw.problem)?;
                return if is_text { Ok(strings(&numbers)) } else { Ok(numbers) };
            }
            // An array of no values may be written as no text at all.
            Form::Base64(text) if text.trim_ascii().is_empty() => {
                return Ok(Numbers::Integer(Vec::new()));
            }
            Form::Base64(text) => Wrapped::Base64(text),
            Form::Appended(offset) => {
                self.appended.and_then(|data| data.behind(offset)).ok_or_else(|| {
                    Problem::unexpected(
                        format!("offset {offset}").as_bytes(),
                        "an offset into the appended data",
                    )
                })?
            }
        };
        let bytes = wrapped.unwrap_array(&self.encoding)?;
        // The last byte of bits may hold more than there are values.
        let count = tuples.map(|tuples| (tuples as u64).saturating_mul(element.components as u64));
        let numbers = kind.decode(&bytes, self.encoding.big_endian, count);
        if is_text { Ok(strings(&numbers)) } else { Ok(numbers) }
    }

    fn piece(&self, index: usize) -> Result<Dataset, Flaw> {
        let Some(piece) = self.pieces.get(index) else { return Ok(Dataset::default()) };
        let mut dataset = Dataset::default();
        if let Some(array) = self.arrays(Some(index), "Points", None)?.into_iter().next() {
            dataset.points = points(array)?;
        }
        Problem::check_count("points of a piece", dataset.points.len(), piece.point_count)?;
        let tuples = Some(dataset.points.len());
        dataset.point_arrays = self.arrays(Some(index), "PointData", tuples)?;
        if self.polygonal {
            // Cell data are in the order in which VTK numbers the cells, which is this one.
            for kind in Kind::ALL {
                let connectivity = self.integers(index, kind.element(), "connectivity")?;
                let offsets = self.integers(index, kind.element(), "offsets")?;
                let mut start = 0;
                for end in offsets {
                    let vertices = row(&connectivity, dataset.cells.len(), start, end)?;
                    push_cell(&mut dataset.cells, kind.cell_type(vertices.len()), vertices)?;
                    start = end;
                }
            }
        } else {
            self.unstructured_cells(index, &mut dataset.cells)?;
            let count = dataset.cells.len();
            Problem::check_count("cells of a piece", count, piece.cell_count.unwrap_or(count))?;
        }
        let tuples = Some(dataset.cells.len());
        dataset.cell_arrays = self.arrays(Some(index), "CellData", tuples)?;
        Ok(dataset)
    }

    fn unstructured_cells(&self, piece: usize, cells: &mut Cells) -> Result<(), Flaw> {
        let connectivity = self.integers(piece, "Cells", "connectivity")?;
        let offsets = self.integers(piece, "Cells", "offsets")?;
        let types = self.integers(piece, "Cells", "types")?;
        Problem::check_count("cell types", types.len(), offsets.len())?;
        let polyhedra = Polyhedra {
            faces: self.integers(piece, "Cells", "faces")?,
            face_ends: self.integers(piece, "Cells", "faceoffsets")?,
            face_connectivity: self.integers(piece, "Cells", "face_connectivity")?,
            face_offsets: self.integers(piece, "Cells", "face_offsets")?,
            to_faces: self.integers(piece, "Cells", "polyhedron_to_faces")?,
            offsets: self.integers(piece, "Cells", "polyhedron_offsets")?,
        };
        let mut start = 0;
        // A face lies between two cells at most, so a file cannot make more of its faces than this.
        let mut numbers_left = 2
            * (polyhedra.face_connectivity.len() + polyhedra.to_faces.len() + types.len())
            + polyhedra.faces.len();
        for (cell, (&end, &cell_type)) in offsets.iter().zip(&types).enumerate() {
            let vertices = row(&connectivity, cell, start, end)?;
            if cell_type == 42 {
                let stream = polyhedra.stream(cell, numbers_left)?;
                numbers_left = numbers_left.saturating_sub(stream.len());
                push_polyhedron(cells, &stream)?;
            } else {
                push_cell(cells, cell_type, vertices)?;
            }
            start = end;
        }
        Ok(())
    }

    /// An array of integers; nothing where there is none.
    fn integers(&self, piece: usize, section: &str, name: &str) -> Result<Vec<i64>, Flaw> {
        let of_name = |element: &&Element| {
            element.section == section && element.name.eq_ignore_ascii_case(name)
        };
        match self.elements_of(Some(piece)).find(of_name) {
            Some(element) => {
                Ok(self.array(element, None)?.integers().map_err(at(element.position))?)
            }
            None => Ok(Vec::new()),
        }
    }
}

/// The faces of polyhedra: as streams, or (from file version 2.3 on) as two levels of compressed
/// rows.
struct Polyhedra {
    faces: Vec<i64>,
    face_ends: Vec<i64>,
    face_connectivity: Vec<i64>,
    face_offsets: Vec<i64>,
    to_faces: Vec<i64>,
    offsets: Vec<i64>,
}

impl Polyhedra {
    /// The faces of a cell as a stream of at most so many numbers.
    fn stream(&self, cell: usize, most: usize) -> Result<Vec<i64>, Problem> {
        if self.face_offsets.is_empty() {
            let end = self.face_ends.get(cell).copied().unwrap_or(-1);
            // Cells that are no polyhedra have the end -1.
            let before = self.face_ends.get(..cell).unwrap_or(&[]);
            let start = before.iter().rev().copied().find(|&end| end >= 0).unwrap_or(0);
            return Ok(row(&self.faces, cell, start, end)?.to_vec());
        }
        let (start, end) = ends(&self.offsets, cell);
        let faces = row(&self.to_faces, cell, start, end)?;
        let mut stream = vec![faces.len() as i64];
        for &face in faces {
            let (start, end) =
                ends(&self.face_offsets, usize::try_from(face).unwrap_or(usize::MAX));
            let vertices = row(&self.face_connectivity, cell, start, end)?;
            if stream.len() + vertices.len() >= most {
                return Err(Problem::unexpected(
                    b"faces used again",
                    "each face in at most two polyhedra",
                ));
            }
            stream.push(vertices.len() as i64);
            stream.extend(vertices);
        }
        Ok(stream)
    }
}

/// Where a row starts and ends by the ends of all rows; the end is -1, which no row has, beyond the
/// last.
fn ends(offsets: &[i64], index: usize) -> (i64, i64) {
    let start = index.checked_sub(1).map_or(Some(0), |before| offsets.get(before).copied());
    (start.unwrap_or(-1), offsets.get(index).copied().unwrap_or(-1))
}

fn strings(numbers: &Numbers) -> Numbers {
    let Numbers::Integer(codes) = numbers else { return Numbers::Text(Vec::new()) };
    // VTK writes the codes of bytes beyond ASCII as negative numbers into text files.
    let bytes: Vec<u8> =
        codes.iter().map(|&code| u8::try_from(code.rem_euclid(256)).unwrap_or(b'?')).collect();
    let ended = bytes.strip_suffix(&[0]).unwrap_or(&bytes);
    if bytes.is_empty() {
        return Numbers::Text(Vec::new());
    }
    Numbers::Text(
        ended
            .split(|&byte| byte == 0)
            .map(|text| String::from_utf8_lossy(text).into_owned())
            .collect(),
    )
}

fn appended<'a>(element: &BytesStart, rest: &'a [u8]) -> Result<Wrapped<'a>, Problem> {
    let start = rest.iter().position(|&byte| byte == b'_').ok_or_else(|| {
        Problem::unexpected(b"no underscore", "the '_' in front of appended data")
    })?;
    let data = rest.get(start + 1..).unwrap_or(&[]);
    match attribute(element, "encoding")?.as_deref() {
        Some("raw") => Ok(Wrapped::Raw(data)),
        Some("base64") | None => {
            // The text ends where the closing tag begins.
            let end = data.iter().position(|&byte| byte == b'<').unwrap_or(data.len());
            Ok(Wrapped::Base64(data.get(..end).unwrap_or(data)))
        }
        Some(other) => Err(Problem::unexpected(other.as_bytes(), "encoding raw or base64")),
    }
}
