//! Sections of .msh files up to version 2.2.

use std::collections::HashSet;

use tombolo_deform::mesh::{Cells, Vector};

use super::super::error::{Flaw, Problem};
use super::elements::{element, push};
use super::{NodeNumbers, Reader, point};

pub(super) fn nodes(reader: &mut Reader) -> Result<(Vec<Vector>, NodeNumbers), Flaw> {
    let count: u64 = reader.scanner.number("the number of nodes")?;
    reader.begin_data();
    let count = reader.count(count, 28, 4, "nodes")?;
    let mut numbers = NodeNumbers::with_capacity(count);
    let mut points = Vec::with_capacity(count);
    for _ in 0..count {
        let tag = node_tag(reader)?;
        numbers.insert(tag, reader)?;
        points.push(point(reader)?);
    }
    Ok((points, numbers))
}

fn node_tag(reader: &mut Reader) -> Result<u64, Flaw> {
    let tag = reader.int("a node's number")?;
    u64::try_from(tag).map_err(|_| {
        reader.scanner.flaw(Problem::unexpected(tag.to_string().as_bytes(), "a node's number"))
    })
}

/// Appends the elements; returns the physical tag of each.
pub(super) fn elements(
    reader: &mut Reader,
    nodes: &NodeNumbers,
    cells: &mut Cells,
    notes: &mut Vec<String>,
) -> Result<Vec<Option<i64>>, Flaw> {
    let count: u64 = reader.scanner.number("the number of elements")?;
    reader.begin_data();
    let count = reader.count(count, 8, 4, "elements")?;
    let mut tags = Vec::with_capacity(count);
    // An entity of several physical groups is written once for each.
    let mut seen = HashSet::new();
    let mut repeated = 0;
    let mut done = 0;
    while done < count {
        let (cell_type, in_block, tag_count) = if reader.scanner.binary {
            (
                reader.int("an element type")?,
                reader.int("a number of elements")?,
                reader.int("a number of tags")?,
            )
        } else {
            reader.int("an element's number")?;
            (reader.int("an element type")?, 1, reader.int("a number of tags")?)
        };
        let kind = element(cell_type, reader)?;
        let (Ok(in_block), Ok(tag_count)) = (u64::try_from(in_block), u64::try_from(tag_count))
        else {
            return Err(reader
                .scanner
                .flaw(Problem::unexpected(b"a negative count", "a count of elements and tags")));
        };
        if in_block == 0 || in_block > (count - done) as u64 {
            let what = "elements in a block".to_owned();
            return Err(reader.scanner.flaw(Problem::Count {
                what,
                found: in_block,
                expected: (count - done) as u64,
            }));
        }
        let tag_count = reader.count(tag_count, 4, 1, "tags of an element")?;
        for _ in 0..in_block {
            if reader.scanner.binary {
                reader.int("an element's number")?;
            }
            let mut physical = 0;
            for index in 0..tag_count {
                let tag = reader.int("a tag of an element")?;
                if index == 0 {
                    physical = tag;
                }
            }
            let mut vertices = Vec::with_capacity(kind.nodes);
            for _ in 0..kind.nodes {
                let tag = node_tag(reader)?;
                vertices.push(nodes.vertex(tag, reader)?);
            }
            done += 1;
            if kind.cell_type.dimension() >= 2 && !seen.insert(vertices.clone()) {
                repeated += 1;
                continue;
            }
            push(cells, kind.cell_type, &mut vertices)?;
            // A negative tag says that the entity is turned round in its group.
            tags.push((physical != 0).then_some(i64::from(physical.unsigned_abs())));
        }
    }
    if repeated > 0 {
        notes.push(format!(
            "left out: {repeated} elements given again for a further physical group"
        ));
    }
    Ok(tags)
}
