//! Overlapping grids of several levels, and the nesting sets that say which cells finer grids
//! cover.

use tombolo::foreign::RunError;
use tombolo::foreign::mesh::{Coordset, Domain, Grid, Mask, Topology};

use super::coordset::counts;
use crate::node::Node;

/// Reads a domain as a grid among others; `None` for one that is no uniform grid.
pub(super) fn grid(node: &Node<'_, '_>, domain: &Domain<'_>) -> Result<Option<Grid>, RunError> {
    let (Coordset::Uniform { origin, spacing, .. }, Topology::Grid { cells }) =
        (&domain.coordset, &domain.topology)
    else {
        return Ok(None);
    };
    let state = node.child(c"state");
    let number = |name| {
        state
            .as_ref()
            .and_then(|state| state.child(name))
            .map(|child| whole_number(&child))
            .transpose()
    };
    let (id, level) = (number(c"domain_id")?, number(c"level")?);
    Ok(Some(Grid { id, level, lower: *origin, spacing: *spacing, cells: *cells }))
}

/// Reads the windows of a domain's nesting sets that its children fill.
pub(super) fn mask(domain: &Node<'_, '_>, cells: [usize; 3]) -> Result<Mask, RunError> {
    let mut mask = Mask::new(cells);
    let Some(sets) = domain.child(c"nestsets") else { return Ok(mask) };
    let origin = first_cell(domain)?;
    sets.each(|set| {
        let Some(windows) = set.child(c"windows") else { return Ok(()) };
        windows.each(|window| {
            if window.need(c"domain_type", "'child' or 'parent'")?.text()? != "child" {
                return Ok(());
            }
            let (counts, _) = counts(&window.need(c"dims", "the cells that the child covers")?)?;
            let corner = whole_numbers(
                &window.need(c"origin", "the first cell that the child covers")?,
                ["i", "j", "k"],
            )?;
            let origin = std::array::from_fn(|axis| corner[axis] - origin[axis]);
            let child = window.child(c"domain_id").map(|child| whole_number(&child)).transpose()?;
            mask.cover(child, origin, counts.map(|count| count.max(1)));
            Ok(())
        })
    })?;
    Ok(mask)
}

/// Where a grid begins among the cells of its level.
fn first_cell(domain: &Node<'_, '_>) -> Result<[i64; 3], RunError> {
    let Some(topologies) = domain.child(c"topologies") else { return Ok([0; 3]) };
    let names = topologies.names();
    let Some(topology) = names.first().and_then(|name| topologies.at(0, name)) else {
        return Ok([0; 3]);
    };
    let Some(elements) = topology.child(c"elements") else { return Ok([0; 3]) };
    match elements.child(c"origin") {
        Some(origin) => whole_numbers(&origin, ["i0", "j0", "k0"]),
        None => Ok([0; 3]),
    }
}

fn whole_numbers(node: &Node<'_, '_>, names: [&str; 3]) -> Result<[i64; 3], RunError> {
    let mut numbers = [0; 3];
    for (number, name) in numbers.iter_mut().zip(names) {
        let name = std::ffi::CString::new(name).unwrap_or_default();
        if let Some(child) = node.child(&name) {
            *number = whole_number(&child)?;
        }
    }
    Ok(numbers)
}

fn whole_number(node: &Node<'_, '_>) -> Result<i64, RunError> {
    node.integer("one whole number")
}
