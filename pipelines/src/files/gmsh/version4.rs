//! Sections of .msh files of version 4.1.

use std::collections::HashMap;

use tombolo_deform::mesh::{Cells, Vector};

use super::super::error::{Flaw, Problem};
use super::elements::{element, push};
use super::{NodeNumbers, Reader, point};

/// The first physical tag of each entity, by its dimension and tag.
#[derive(Default)]
pub(super) struct PhysicalTags(HashMap<(i32, i32), i64>);

impl PhysicalTags {
    /// Reads the section of entities, or that of partitioned entities.
    pub fn read(&mut self, reader: &mut Reader, partitioned: bool) -> Result<(), Flaw> {
        reader.begin_data();
        if partitioned {
            reader.size("the number of partitions")?;
            let ghosts = reader.size("the number of ghost entities")?;
            for _ in 0..reader.count(ghosts, 8, 2, "ghost entities")? {
                reader.int("the tag of a ghost entity")?;
                reader.int("the partition of a ghost entity")?;
            }
        }
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = reader.size("a number of entities")?;
        }
        for (dimension, count) in (0i32..).zip(counts) {
            for _ in 0..reader.count(count, 36, 5, "entities")? {
                let tag = reader.int("the tag of an entity")?;
                if partitioned {
                    reader.int("the dimension of a parent entity")?;
                    reader.int("the tag of a parent entity")?;
                    let partitions = reader.size("a number of partitions")?;
                    for _ in 0..reader.count(partitions, 4, 1, "partitions")? {
                        reader.int("a partition")?;
                    }
                }
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    reader.double("a bound of an entity")?;
                }
                let physical_count = reader.size("a number of physical tags")?;
                for index in 0..reader.count(physical_count, 4, 1, "physical tags")? {
                    let physical = reader.int("a physical tag")?;
                    if index == 0 {
                        // A negative tag says that the entity is turned round in its group.
                        self.0.insert((dimension, tag), i64::from(physical.unsigned_abs()));
                    }
                }
                if dimension > 0 {
                    let bounding = reader.size("a number of bounding entities")?;
                    for _ in 0..reader.count(bounding, 4, 1, "bounding entities")? {
                        reader.int("the tag of a bounding entity")?;
                    }
                }
            }
        }
        Ok(())
    }
}

pub(super) fn nodes(reader: &mut Reader) -> Result<(Vec<Vector>, NodeNumbers), Flaw> {
    reader.begin_data();
    let blocks = reader.size("the number of node blocks")?;
    let count = reader.size("the number of nodes")?;
    reader.size("the lowest node tag")?;
    reader.size("the highest node tag")?;
    let count = reader.count(count, 24 + reader.size_width, 4, "nodes")?;
    let mut numbers = NodeNumbers::with_capacity(count);
    let mut points = Vec::with_capacity(count);
    for _ in 0..reader.count(blocks, 12 + reader.size_width, 4, "node blocks")? {
        let dimension = reader.int("the dimension of an entity")?;
        reader.int("the tag of an entity")?;
        let parametric = reader.int("0 or 1: whether nodes are parametric")?;
        let in_block = reader.size("a number of nodes")?;
        for _ in 0..reader.count(in_block, 24 + reader.size_width, 4, "nodes")? {
            let tag = reader.size("a node's tag")?;
            numbers.insert(tag, reader)?;
        }
        for _ in 0..in_block {
            points.push(point(reader)?);
            if parametric != 0 {
                for _ in 0..dimension.clamp(0, 3) {
                    reader.double("a parametric coordinate")?;
                }
            }
        }
    }
    Problem::check_count("nodes in the blocks of $Nodes", points.len(), count)
        .map_err(|problem| reader.scanner.flaw(problem))?;
    Ok((points, numbers))
}

/// Appends the elements; returns the physical tag of each.
pub(super) fn elements(
    reader: &mut Reader,
    nodes: &NodeNumbers,
    physical: &PhysicalTags,
    cells: &mut Cells,
) -> Result<Vec<Option<i64>>, Flaw> {
    reader.begin_data();
    let blocks = reader.size("the number of element blocks")?;
    let count = reader.size("the number of elements")?;
    reader.size("the lowest element tag")?;
    reader.size("the highest element tag")?;
    let count = reader.count(count, 2 * reader.size_width, 2, "elements")?;
    let mut tags = Vec::with_capacity(count);
    for _ in 0..reader.count(blocks, 12 + reader.size_width, 4, "element blocks")? {
        let dimension = reader.int("the dimension of an entity")?;
        let entity = reader.int("the tag of an entity")?;
        let kind = reader.int("an element type")?;
        let kind = element(kind, reader)?;
        let in_block = reader.size("a number of elements")?;
        let tag = physical.0.get(&(dimension, entity)).copied();
        for _ in 0..reader.count(
            in_block,
            (1 + kind.nodes) * reader.size_width,
            1 + kind.nodes,
            "elements",
        )? {
            reader.size("an element's tag")?;
            let mut vertices = [0; 8];
            let vertices = vertices.get_mut(..kind.nodes).unwrap_or(&mut []);
            for vertex in &mut *vertices {
                let node = reader.size("a node's tag")?;
                *vertex = nodes.vertex(node, reader)?;
            }
            push(cells, kind.cell_type, vertices)?;
            tags.push(tag);
        }
    }
    Problem::check_count("elements in the blocks of $Elements", tags.len(), count)
        .map_err(|problem| reader.scanner.flaw(problem))?;
    Ok(tags)
}
