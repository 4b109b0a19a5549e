//! Overlapping grids of several levels: which cells finer grids cover.

use super::coordset::counts;
use crate::error::CatalystError;
use crate::node::Node;

/// A box of cells: the first along each axis, and how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Covered {
    origin: [i64; 3],
    counts: [usize; 3],
}

/// The cells of a grid that finer grids cover.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Mask {
    cells: [usize; 3],
    covered: Vec<Covered>,
}

impl Mask {
    /// Reads the windows of a domain's nesting sets that its children fill.
    pub(super) fn read(domain: &Node<'_, '_>, cells: [usize; 3]) -> Result<Self, CatalystError> {
        let mut mask = Self { cells, covered: Vec::new() };
        let Some(sets) = domain.child(c"nestsets") else { return Ok(mask) };
        let origin = first_cell(domain)?;
        for (index, name) in sets.names().iter().enumerate() {
            let Some(set) = sets.at(index, name) else { continue };
            let Some(windows) = set.child(c"windows") else { continue };
            for (index, name) in windows.names().iter().enumerate() {
                let Some(window) = windows.at(index, name) else { continue };
                if window.need(c"domain_type", "'child' or 'parent'")?.text()? != "child" {
                    continue;
                }
                let (counts, _) = counts(&window.need(c"dims", "the cells that the child covers")?)?;
                let corner =
                    whole_numbers(&window.need(c"origin", "the first cell that the child covers")?, ["i", "j", "k"])?;
                let origin = std::array::from_fn(|axis| corner[axis] - origin[axis]);
                mask.covered.push(Covered { origin, counts: counts.map(|count| count.max(1)) });
            }
        }
        Ok(mask)
    }

    /// Whether no finer grid covers the cell.
    pub(super) fn keeps(&self, cell: usize) -> bool {
        if self.covered.is_empty() {
            return true;
        }
        let along = |axis: usize| self.cells[axis].max(1);
        let at = [cell % along(0), cell / along(0) % along(1), cell / (along(0) * along(1))];
        !self.covered.iter().any(|window| {
            (0..3).all(|axis| {
                let from = at[axis] as i64 - window.origin[axis];
                from >= 0 && from < window.counts[axis] as i64
            })
        })
    }

    /// Takes what is covered into a fingerprint.
    pub(super) fn words(&self) -> impl Iterator<Item = u64> {
        self.covered.iter().flat_map(|window| {
            let origin = window.origin.map(i64::cast_unsigned);
            origin.into_iter().chain(window.counts.map(|count| count as u64))
        })
    }
}

/// Where a grid begins among the cells of its level.
fn first_cell(domain: &Node<'_, '_>) -> Result<[i64; 3], CatalystError> {
    let Some(topologies) = domain.child(c"topologies") else { return Ok([0; 3]) };
    let names = topologies.names();
    let Some(topology) = names.first().and_then(|name| topologies.at(0, name)) else { return Ok([0; 3]) };
    let Some(elements) = topology.child(c"elements") else { return Ok([0; 3]) };
    match elements.child(c"origin") {
        Some(origin) => whole_numbers(&origin, ["i0", "j0", "k0"]),
        None => Ok([0; 3]),
    }
}

fn whole_numbers(node: &Node<'_, '_>, names: [&str; 3]) -> Result<[i64; 3], CatalystError> {
    let mut numbers = [0; 3];
    for (number, name) in numbers.iter_mut().zip(names) {
        let name = std::ffi::CString::new(name).unwrap_or_default();
        if let Some(child) = node.child(&name) {
            let array = child.array()?;
            let value = (array.len() == 1).then(|| array.integer(0)).flatten();
            *number = value.ok_or_else(|| child.wrong("one whole number".into()))?;
        }
    }
    Ok(numbers)
}
