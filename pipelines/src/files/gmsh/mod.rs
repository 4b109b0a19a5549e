//! Gmsh's .msh files, versions 2.2 and 4.1, text and binary of either byte order.
//!
//! The format is that of the Gmsh reference manual, "Gmsh file formats". Physical surfaces become
//! features. Of the several physical groups that version 4.1 allows an entity, the first counts.

mod elements;
mod version2;
mod version4;

use std::collections::{BTreeMap, HashMap};

use tombolo_deform::mesh::Vector;

use super::MeshFile;
use super::assemble::FileContents;
use super::error::{Flaw, Problem};
use super::scanner::Scanner;

/// Reads a .msh file.
pub(super) fn parse(bytes: &[u8]) -> Result<MeshFile, Flaw> {
    let mut reader = Reader::start(bytes)?;
    let mut contents = FileContents::default();
    let mut nodes = None;
    let mut entities = version4::PhysicalTags::default();
    let mut elements = false;
    loop {
        let header = reader.scanner.word();
        let section = match header.strip_prefix(b"$") {
            Some(section) => section,
            None if header.is_empty() => break,
            None => {
                return Err(reader
                    .scanner
                    .flaw(Problem::unexpected(header, "the '$' of a section")));
            }
        };
        match section {
            b"PhysicalNames" => contents.names = reader.physical_names()?,
            b"Entities" if reader.is_version_4 => entities.read(&mut reader, false)?,
            b"PartitionedEntities" if reader.is_version_4 => entities.read(&mut reader, true)?,
            b"Nodes" => {
                let (points, numbers) = match reader.is_version_4 {
                    true => version4::nodes(&mut reader)?,
                    false => version2::nodes(&mut reader)?,
                };
                contents.points = points;
                nodes = Some(numbers);
            }
            b"Elements" => {
                let nodes = nodes.as_ref().ok_or_else(|| {
                    reader
                        .scanner
                        .flaw(Problem::unexpected(b"$Elements", "$Nodes, which elements refer to,"))
                })?;
                contents.cell_tags = Some(match reader.is_version_4 {
                    true => version4::elements(&mut reader, nodes, &entities, &mut contents.cells)?,
                    false => version2::elements(
                        &mut reader,
                        nodes,
                        &mut contents.cells,
                        &mut contents.notes,
                    )?,
                });
                elements = true;
            }
            b"Periodic" | b"Comments" | b"GhostElements" | b"Parametrizations" => {}
            other => contents
                .notes
                .push(format!("left out: section ${}", String::from_utf8_lossy(other))),
        }
        let end = [b"$End", section].concat();
        if !reader.scanner.skip_behind(&end) {
            let expected = String::from_utf8_lossy(&end).into_owned();
            return Err(reader.scanner.flaw(Problem::unexpected(b"", expected)));
        }
    }
    if !elements {
        return Err(reader.scanner.flaw(Problem::unexpected(b"the end of the file", "$Elements")));
    }
    contents.assemble()
}

/// Numbers from either kind of .msh file.
struct Reader<'a> {
    scanner: Scanner<'a>,
    is_version_4: bool,
    big_endian: bool,
    /// Bytes of a count or tag in binary files of version 4.
    size_width: usize,
}

impl<'a> Reader<'a> {
    fn start(bytes: &'a [u8]) -> Result<Self, Flaw> {
        let mut scanner = Scanner::new(bytes);
        let first = scanner.word();
        if first != b"$MeshFormat" {
            return Err(scanner.flaw(Problem::unexpected(first, "$MeshFormat")));
        }
        let version = scanner.text("the version of the format")?;
        let is_version_4 = match version {
            "2" | "2.0" | "2.1" | "2.2" => false,
            "4.1" => true,
            other => {
                return Err(scanner.flaw(Problem::Unsupported {
                    what: format!("version {other} of the .msh format"),
                    instead: "save it as version 4.1 or 2.2 (gmsh -format msh41)",
                }));
            }
        };
        let kind: u8 = scanner.number("0 for text or 1 for binary")?;
        let size_width: usize = scanner.number("the size of a number in bytes")?;
        if kind > 1 || !matches!(size_width, 4 | 8) {
            let found = format!("{kind} {size_width}");
            return Err(scanner.flaw(Problem::unexpected(
                found.as_bytes(),
                "file type 0 or 1 and data size 4 or 8",
            )));
        }
        if kind == 1 && !is_version_4 && size_width != 8 {
            return Err(scanner.flaw(Problem::unexpected(b"4", "data size 8, of double precision")));
        }
        scanner.binary = kind == 1;
        let mut big_endian = false;
        if scanner.binary {
            scanner.line();
            let one = scanner.take(4, "the number 1 that tells the byte order")?;
            big_endian = match one {
                [1, 0, 0, 0] => false,
                [0, 0, 0, 1] => true,
                other => {
                    return Err(scanner.flaw(Problem::unexpected(
                        other,
                        "the number 1 that tells the byte order",
                    )));
                }
            };
        }
        let mut reader = Self { scanner, is_version_4, big_endian, size_width };
        let end = reader.scanner.word();
        if end != b"$EndMeshFormat" {
            return Err(reader.scanner.flaw(Problem::unexpected(end, "$EndMeshFormat")));
        }
        Ok(reader)
    }

    /// Goes to the first byte behind the section's header, where binary data begins.
    fn begin_data(&mut self) {
        if self.scanner.binary {
            self.scanner.line();
        }
    }

    fn bytes<const N: usize>(&mut self, what: &str) -> Result<[u8; N], Flaw> {
        let mut array = [0; N];
        array.copy_from_slice(self.scanner.take(N as u64, what)?);
        if self.big_endian {
            array.reverse();
        }
        Ok(array)
    }

    fn int(&mut self, what: &str) -> Result<i32, Flaw> {
        if self.scanner.binary {
            Ok(i32::from_le_bytes(self.bytes(what)?))
        } else {
            self.scanner.number(what)
        }
    }

    fn double(&mut self, what: &str) -> Result<f64, Flaw> {
        if self.scanner.binary {
            Ok(f64::from_le_bytes(self.bytes(what)?))
        } else {
            self.scanner.number(what)
        }
    }

    fn size(&mut self, what: &str) -> Result<u64, Flaw> {
        match (self.scanner.binary, self.size_width) {
            (false, _) => self.scanner.number(what),
            (true, 4) => Ok(u64::from(u32::from_le_bytes(self.bytes(what)?))),
            (true, _) => Ok(u64::from_le_bytes(self.bytes(what)?)),
        }
    }

    /// A count of things that take so many bytes each in a binary file, and so many numbers each in
    /// a text file.
    fn count(&self, count: u64, bytes: usize, numbers: usize, what: &str) -> Result<usize, Flaw> {
        self.scanner.check_count(count, if self.scanner.binary { bytes } else { 2 * numbers }, what)
    }

    /// The names of physical surfaces by their tag. This section is text in every file.
    fn physical_names(&mut self) -> Result<BTreeMap<i64, String>, Flaw> {
        let count: u64 = self.scanner.number("the number of physical names")?;
        let mut names = BTreeMap::new();
        self.scanner.line();
        for _ in 0..self.scanner.check_count(count, 6, "physical names")? {
            let dimension: i32 = self.scanner.number("the dimension of a physical group")?;
            let tag: i64 = self.scanner.number("the tag of a physical group")?;
            let line = self.scanner.line();
            let quoted = String::from_utf8_lossy(line);
            let quoted = quoted.trim();
            let name = quoted.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
            let Some(name) = name.filter(|name| !name.is_empty()) else {
                return Err(self
                    .scanner
                    .flaw(Problem::unexpected(line, "a physical name in double quotes")));
            };
            if dimension == 2 {
                names.insert(tag, name.to_owned());
            }
        }
        Ok(names)
    }
}

/// The vertex that each node tag stands for; tags may have gaps.
struct NodeNumbers(HashMap<u64, u32>);

impl NodeNumbers {
    fn with_capacity(count: usize) -> Self {
        Self(HashMap::with_capacity(count))
    }

    /// The next vertex gets this tag.
    fn insert(&mut self, tag: u64, reader: &Reader) -> Result<(), Flaw> {
        let vertex = u32::try_from(self.0.len()).unwrap_or(u32::MAX);
        if vertex == u32::MAX || self.0.insert(tag, vertex).is_some() {
            let found = format!("node {tag} a second time");
            return Err(reader
                .scanner
                .flaw(Problem::unexpected(found.as_bytes(), "a node tag of its own")));
        }
        Ok(())
    }

    fn vertex(&self, tag: u64, reader: &Reader) -> Result<u32, Flaw> {
        self.0.get(&tag).copied().ok_or_else(|| {
            reader.scanner.flaw(Problem::unexpected(
                format!("node {tag}").as_bytes(),
                "a node listed in $Nodes",
            ))
        })
    }
}

/// Three coordinates.
fn point(reader: &mut Reader) -> Result<Vector, Flaw> {
    Ok([
        reader.double("a coordinate")?,
        reader.double("a coordinate")?,
        reader.double("a coordinate")?,
    ])
}
