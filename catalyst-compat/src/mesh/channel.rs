//! A channel's node: one mesh, several blocks, or overlapping grids.

use std::ffi::CString;

use super::amr::{Grid, Mask};
use super::domain::Domain;
use super::field::Field;
use super::topology::Topology;
use crate::array::Fingerprint;
use crate::error::CatalystError;
use crate::memory;
use crate::node::{Kind, Node};

/// One mesh of a channel.
#[derive(Debug)]
pub(crate) struct Block<'call> {
    /// What it is called; empty where the channel is one mesh.
    pub(crate) name: String,
    pub(super) domain: Domain<'call>,
    pub(super) mask: Mask,
}

impl Block<'_> {
    /// How many vertices it has.
    pub(crate) fn vertex_count(&self) -> usize {
        self.domain.coordset.len()
    }
}

/// A channel as the solver shows it in one call.
#[derive(Debug, Default)]
pub(crate) struct Channel<'call> {
    /// Its name.
    pub(crate) name: String,
    /// Its meshes; none on a rank without data.
    pub(crate) blocks: Vec<Block<'call>>,
    /// Names of features by their numbers.
    pub(crate) feature_names: Vec<(i64, String)>,
    /// What belongs to the mesh as a whole.
    pub(crate) of_mesh: Vec<Field<'call>>,
    /// The grids of levels that the blocks are; none of a channel without levels.
    pub(crate) grids: Vec<Option<Grid>>,
    /// What is passed over, for the log.
    pub(crate) notes: Vec<String>,
}

const KINDS: &str = "'mesh', 'multimesh' or 'amrmesh'";

impl<'call> Channel<'call> {
    /// Reads a channel. No value of an array is looked at; where nobody will look at any (`looked_at`), fields are passed over.
    pub(crate) fn read(node: &Node<'_, 'call>, looked_at: bool) -> Result<Self, CatalystError> {
        let mut channel = Self { name: node.name().into_owned(), ..Self::default() };
        // A rank without data may leave its channel empty.
        if node.kind() == Kind::Empty {
            return Ok(channel);
        }
        let kind = node.need(c"type", KINDS)?;
        refuse_devices(node)?;
        let kind_name = kind.text()?;
        if !matches!(&*kind_name, "mesh" | "multimesh" | "amrmesh") {
            return Err(kind.wrong_found(format!("'{kind_name}'"), KINDS.into()));
        }
        let Some(data) = node.child(c"data") else {
            return Ok(channel);
        };
        if !matches!(data.kind(), Kind::Object | Kind::List | Kind::Empty) {
            return Err(data.wrong("an object: a mesh, or meshes by their names".into()));
        }
        channel.feature_names = feature_names(node)?;
        channel.read_of_mesh(node)?;
        channel.read_of_mesh(&data)?;
        if kind_name == "mesh" {
            channel.feature_names.extend(feature_names(&data)?);
        }
        // A mesh may come in domains, as those of several blocks do.
        let has_domains = data.child(c"coordsets").is_none()
            && data
                .names()
                .first()
                .and_then(|name| data.at(0, name)?.child(c"coordsets").map(drop))
                .is_some();
        if kind_name == "mesh" && !has_domains {
            channel.push(String::new(), &data, false, looked_at)?;
        } else {
            let has_levels = kind_name == "amrmesh";
            for (index, name) in data.names().iter().enumerate() {
                let Some(block) = data.at(index, name) else { continue };
                channel.push(name.to_string_lossy().into_owned(), &block, has_levels, looked_at)?;
                channel.read_of_mesh(&block)?;
            }
            let own: Vec<Grid> = channel.grids().collect();
            channel.cover(&own);
        }
        channel.refuse_too_many()?;
        Ok(channel)
    }

    fn push(
        &mut self,
        name: String,
        node: &Node<'_, 'call>,
        has_levels: bool,
        looked_at: bool,
    ) -> Result<(), CatalystError> {
        let Some(domain) = Domain::read(node, looked_at)? else { return Ok(()) };
        let mut mask = Mask::default();
        if has_levels {
            if let Topology::Grid { cells } = &domain.topology {
                mask = Mask::read(node, *cells)?;
            }
            self.grids.push(Grid::read(node, &domain)?);
        }
        self.blocks.push(Block { name, domain, mask });
        Ok(())
    }

    /// The grids of levels here.
    pub(crate) fn grids(&self) -> impl Iterator<Item = Grid> {
        self.grids.iter().flatten().copied()
    }

    /// Leaves out the cells that finer ones of these grids cover.
    pub(crate) fn cover(&mut self, grids: &[Grid]) {
        for (block, own) in self.blocks.iter_mut().zip(&self.grids) {
            if let Some(own) = own {
                block.mask.settle(own, grids);
            }
        }
    }

    /// Whether its blocks are grids of levels, whose vertices at one place are one.
    pub(super) fn has_levels(&self) -> bool {
        self.grids.iter().any(Option::is_some)
    }

    /// Takes `state/fields` in; the first that says a name holds.
    fn read_of_mesh(&mut self, node: &Node<'_, 'call>) -> Result<(), CatalystError> {
        let Some(state) = node.child(c"state") else { return Ok(()) };
        let Some(fields) = state.child(c"fields") else { return Ok(()) };
        for (index, name) in fields.names().iter().enumerate() {
            let Some(child) = fields.at(index, name) else { continue };
            if self.of_mesh.iter().any(|field| field.name.as_bytes() == name.to_bytes()) {
                continue;
            }
            match Field::read_of_mesh(&child)? {
                Some(field) => self.of_mesh.push(field),
                None => self.notes.push(format!(
                    "'{}' is passed over: fields hold numbers, not texts",
                    child.path()
                )),
            }
        }
        Ok(())
    }

    fn refuse_too_many(&self) -> Result<(), CatalystError> {
        let vertices: usize = self.blocks.iter().map(Block::vertex_count).sum();
        if u32::try_from(vertices).is_ok() {
            return Ok(());
        }
        Err(CatalystError::Wrong {
            path: format!("catalyst/channels/{}/data", self.name),
            found: format!("{vertices} vertices"),
            expected: format!("at most {} on one rank", u32::MAX),
        })
    }

    /// How many vertices it has.
    pub(crate) fn vertex_count(&self) -> usize {
        self.blocks.iter().map(Block::vertex_count).sum()
    }

    /// The one mesh that is lent as it is.
    pub(super) fn single(&self) -> Option<&Domain<'call>> {
        match self.blocks.as_slice() {
            [Block { domain, mask, .. }] if *mask == Mask::default() => Some(domain),
            _ => None,
        }
    }

    /// What tells these cells from others.
    pub(super) fn fingerprint(&self) -> Fingerprint {
        let mut fingerprint = Fingerprint::default();
        for block in &self.blocks {
            block.domain.fingerprint(&mut fingerprint);
            block.mask.words().for_each(|word| fingerprint.add(word));
        }
        fingerprint
    }

    /// Refuses arrays whose memory cannot be read.
    pub(crate) fn check_memory(&self) -> Result<(), CatalystError> {
        self.blocks.iter().try_for_each(|block| block.domain.check_memory())?;
        for field in &self.of_mesh {
            if let Some(found) = field.components.iter().find_map(memory::fault) {
                return Err(CatalystError::Wrong {
                    path: format!("catalyst/channels/{}/state/fields/{}", self.name, field.name),
                    found,
                    expected:
                        "values in the main memory of this process, not in that of a graphics card"
                            .into(),
                });
            }
        }
        Ok(())
    }
}

/// `memoryspace` says where the arrays lie, as ParaView's Catalyst has it.
fn refuse_devices(node: &Node<'_, '_>) -> Result<(), CatalystError> {
    for name in [c"memoryspace", c"memory_space"] {
        if let Some(space) = node.child(name) {
            let text = space.text()?;
            if !["", "serial", "host", "openmp", "tbb"]
                .contains(&text.to_ascii_lowercase().as_str())
            {
                return Err(space.wrong_found(
                    format!("'{text}'"),
                    "'host': arrays in a graphics card's memory are copied to the main memory by the solver".into(),
                ));
            }
        }
    }
    Ok(())
}

/// `state/features/<name>` is the number of a feature.
fn feature_names(node: &Node<'_, '_>) -> Result<Vec<(i64, String)>, CatalystError> {
    let Some(state) = node.child(c"state") else { return Ok(Vec::new()) };
    let Some(features) = state.child(c"features") else { return Ok(Vec::new()) };
    let names: Vec<CString> = features.names();
    let mut found = Vec::with_capacity(names.len());
    for (index, name) in names.iter().enumerate() {
        let Some(child) = features.at(index, name) else { continue };
        let array = child.array()?;
        let number = (array.len() == 1).then(|| array.integer(0)).flatten();
        let number =
            number.ok_or_else(|| child.wrong("one whole number, that of the feature".into()))?;
        found.push((number, name.to_string_lossy().into_owned()));
    }
    Ok(found)
}
