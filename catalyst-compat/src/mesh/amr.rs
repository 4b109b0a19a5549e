//! Overlapping grids of several levels: which cells finer grids cover.

use super::coordset::{Coordset, counts};
use super::domain::Domain;
use super::topology::Topology;
use crate::error::CatalystError;
use crate::node::Node;

/// A grid among those of its channel: what nesting sets call it, how fine it is, and where it lies.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Grid {
    id: Option<i64>,
    level: i64,
    #[serde(with = "bits")]
    lower: [f64; 3],
    #[serde(with = "bits")]
    spacing: [f64; 3],
    cells: [usize; 3],
}

/// Numbers as they are, to the last bit.
mod bits {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    pub(super) fn serialize<S: Serializer>(
        numbers: &[f64; 3],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        numbers.map(f64::to_bits).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<[f64; 3], D::Error> {
        Ok(<[u64; 3]>::deserialize(deserializer)?.map(f64::from_bits))
    }
}

impl Grid {
    /// Reads a domain that says its level; `None` for one that does not, or is no uniform grid.
    pub(super) fn read(
        node: &Node<'_, '_>,
        domain: &Domain<'_>,
    ) -> Result<Option<Self>, CatalystError> {
        let (Coordset::Uniform { origin, spacing, .. }, Topology::Grid { cells }) =
            (&domain.coordset, &domain.topology)
        else {
            return Ok(None);
        };
        let Some(state) = node.child(c"state") else { return Ok(None) };
        let number = |name| state.child(name).map(|child| whole_number(&child)).transpose();
        let (id, level) = (number(c"domain_id")?, number(c"level")?);
        Ok(level.map(|level| Self { id, level, lower: *origin, spacing: *spacing, cells: *cells }))
    }

    /// The least distance between two of its points along an axis.
    pub(super) fn least_spacing(&self) -> f64 {
        (0..3)
            .filter(|&axis| self.cells[axis] > 0)
            .map(|axis| self.spacing[axis].abs())
            .fold(f64::INFINITY, f64::min)
    }

    /// The cells of this grid whose middle lies in a finer one.
    fn covered_by(&self, finer: &Grid) -> Option<Covered> {
        let mut covered = Covered { child: None, origin: [0; 3], counts: [1; 3] };
        for axis in (0..3).filter(|&axis| self.cells[axis] > 0) {
            #[expect(clippy::cast_precision_loss, reason = "a number of cells below 2^32")]
            let [own, length] =
                [self.cells[axis] as f64, finer.cells[axis] as f64 * finer.spacing[axis]];
            let at = |place: f64| {
                ((place - self.lower[axis]) / self.spacing[axis] - 0.5).ceil().clamp(0.0, own)
            };
            let (from, to) = (at(finer.lower[axis]), at(finer.lower[axis] + length));
            // False for what is no number, too.
            let has_any = from < to;
            if !has_any {
                return None;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "from 0 to the number of cells"
            )]
            {
                covered.origin[axis] = from as i64;
                covered.counts[axis] = (to - from) as usize;
            }
        }
        Some(covered)
    }
}

/// A box of cells: the first along each axis, and how many; and the domain that was said to cover them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Covered {
    child: Option<i64>,
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
                let (counts, _) =
                    counts(&window.need(c"dims", "the cells that the child covers")?)?;
                let corner = whole_numbers(
                    &window.need(c"origin", "the first cell that the child covers")?,
                    ["i", "j", "k"],
                )?;
                let origin = std::array::from_fn(|axis| corner[axis] - origin[axis]);
                let child =
                    window.child(c"domain_id").map(|child| whole_number(&child)).transpose()?;
                mask.covered.push(Covered {
                    child,
                    origin,
                    counts: counts.map(|count| count.max(1)),
                });
            }
        }
        Ok(mask)
    }

    /// Takes the word of the finer grids that are known for what they cover. Windows tell of those that are not; one that names
    /// its own grid tells nothing.
    pub(super) fn settle(&mut self, own: &Grid, others: &[Grid]) {
        let known = |id: i64| own.id == Some(id) || others.iter().any(|grid| grid.id == Some(id));
        self.covered.retain(|window| !window.child.is_some_and(known));
        let finer = others.iter().filter(|grid| grid.level > own.level);
        self.covered.extend(finer.filter_map(|finer| own.covered_by(finer)));
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
    let Some(topology) = names.first().and_then(|name| topologies.at(0, name)) else {
        return Ok([0; 3]);
    };
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
            *number = whole_number(&child)?;
        }
    }
    Ok(numbers)
}

fn whole_number(node: &Node<'_, '_>) -> Result<i64, CatalystError> {
    let array = node.array()?;
    let value = (array.len() == 1).then(|| array.integer(0)).flatten();
    value.ok_or_else(|| node.wrong("one whole number".into()))
}
