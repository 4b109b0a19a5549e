//! A channel's node: one mesh, several blocks, or overlapping grids.

use tombolo::foreign::RunError;
use tombolo::foreign::mesh::{Block, Channel, Grid, Label, Mask, Topology};

use super::{amr, domain, field};
use crate::node::{Kind, Node};

const KINDS: &str = "'mesh', 'multimesh' or 'amrmesh'";

/// Reads a channel. No value of an array is looked at; where nobody will look at any (`looked_at`),
/// fields are passed over.
pub(crate) fn read<'call>(
    node: &Node<'_, 'call>,
    looked_at: bool,
) -> Result<Channel<'call>, RunError> {
    let mut channel = Channel {
        name: node.name().into_owned(),
        label: Label::Path(node.path()),
        ..Channel::default()
    };
    // A rank without data may leave its channel empty.
    if node.kind() == Kind::Empty {
        return Ok(channel);
    }
    let kind = node.need(c"type", KINDS)?;
    refuse_devices(node)?;
    let kind_name = kind.text()?;
    if !matches!(&*kind_name, "mesh" | "multimesh" | "amrmesh") {
        return Err(kind.wrong_found(format!("'{kind_name}'"), KINDS));
    }
    let Some(data) = node.child(c"data") else {
        return Ok(channel);
    };
    if !matches!(data.kind(), Kind::Object | Kind::List | Kind::Empty) {
        return Err(data.wrong("an object: a mesh, or meshes by their names"));
    }
    channel.feature_names = feature_names(node)?;
    read_of_mesh(&mut channel, node)?;
    read_of_mesh(&mut channel, &data)?;
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
        push(&mut channel, String::new(), &data, false, looked_at)?;
    } else {
        let has_levels = kind_name == "amrmesh";
        data.each(|block| {
            push(&mut channel, block.name().into_owned(), block, has_levels, looked_at)?;
            read_of_mesh(&mut channel, block)
        })?;
        let own: Vec<Grid> = channel.grids().collect();
        channel.cover(&own);
    }
    refuse_too_many(&channel, node)?;
    Ok(channel)
}

/// Whether a channel is said to have several meshes by their names; one that is left empty says
/// nothing.
pub(crate) fn has_blocks(node: &Node<'_, '_>) -> bool {
    let kind = node.child(c"type");
    kind.is_some_and(|kind| kind.text().is_ok_and(|kind| matches!(&*kind, "multimesh" | "amrmesh")))
}

fn push<'call>(
    channel: &mut Channel<'call>,
    name: String,
    node: &Node<'_, 'call>,
    has_levels: bool,
    looked_at: bool,
) -> Result<(), RunError> {
    let Some(domain) = domain::read(node, looked_at, &mut channel.notes)? else { return Ok(()) };
    let mut mask = Mask::default();
    if has_levels {
        if let Topology::Grid { cells } = &domain.topology {
            mask = amr::mask(node, *cells)?;
        }
        channel.grids.push(amr::grid(node, &domain)?);
    }
    channel.blocks.push(Block { name, domain, mask });
    Ok(())
}

/// Takes `state/fields` in; the first that says a name holds.
fn read_of_mesh<'call>(
    channel: &mut Channel<'call>,
    node: &Node<'_, 'call>,
) -> Result<(), RunError> {
    let Some(state) = node.child(c"state") else { return Ok(()) };
    let Some(fields) = state.child(c"fields") else { return Ok(()) };
    fields.each(|child| {
        if channel.of_mesh.iter().any(|field| field.name == child.name()) {
            return Ok(());
        }
        match field::read_of_mesh(child)? {
            Some(field) => channel.of_mesh.push(field),
            None => channel
                .notes
                .push(format!("'{}' is passed over: fields hold numbers, not texts", child.path())),
        }
        Ok(())
    })
}

fn refuse_too_many(channel: &Channel<'_>, node: &Node<'_, '_>) -> Result<(), RunError> {
    let vertices = channel.vertex_count();
    if u32::try_from(vertices).is_ok() {
        return Ok(());
    }
    let most = u32::MAX;
    let path = format!("{}/data", node.path());
    Err(RunError::wrong(
        path,
        format!("{vertices} vertices"),
        format!("at most {most} on one rank"),
    ))
}

/// `memoryspace` says where the arrays lie, as ParaView's Catalyst has it.
fn refuse_devices(node: &Node<'_, '_>) -> Result<(), RunError> {
    for name in [c"memoryspace", c"memory_space"] {
        if let Some(space) = node.child(name) {
            let text = space.text()?;
            if !["", "serial", "host", "openmp", "tbb"]
                .contains(&text.to_ascii_lowercase().as_str())
            {
                return Err(space.wrong_found(
                    format!("'{text}'"),
                    "'host': arrays in a graphics card's memory are copied to the main memory by the solver",
                ));
            }
        }
    }
    Ok(())
}

/// `state/features/<name>` is the number of a feature.
fn feature_names(node: &Node<'_, '_>) -> Result<Vec<(i64, String)>, RunError> {
    let Some(state) = node.child(c"state") else { return Ok(Vec::new()) };
    let Some(features) = state.child(c"features") else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    features.each(|child| {
        found.push((
            child.integer("one whole number, that of the feature")?,
            child.name().into_owned(),
        ));
        Ok(())
    })?;
    Ok(found)
}
