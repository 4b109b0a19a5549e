//! One mesh of the Blueprint: a topology with its coordinates, its fields and its features.

use std::ffi::CString;

use tombolo::foreign::RunError;
use tombolo::foreign::mesh::{Domain, Faces, Field, Label, Roles, Topology};
use tombolo::pipelines::extract::{Association, GHOST_FIELD};

use super::{coordset, field, topology};
use crate::node::{Kind, Node};

/// The name in ParaView's Catalyst of the field that says which cells or vertices are copies of
/// another rank's.
const GHOSTS: &str = "Ghosts";

/// A topology and what it is called.
struct Named<'call> {
    name: String,
    coordset: CString,
    topology: Topology<'call>,
    /// The dimension of its cells, where there are others besides.
    dimension: usize,
}

/// Reads a mesh; `None` for one that says nothing, as that of a rank without cells may. What is
/// passed over is added to the notes.
pub(super) fn read<'call>(
    node: &Node<'_, 'call>,
    with_fields: bool,
    notes: &mut Vec<String>,
) -> Result<Option<Domain<'call>>, RunError> {
    if node.kind() == Kind::Empty || (node.kind() == Kind::Object && node.len() == 0) {
        return Ok(None);
    }
    let coordsets = node.need(c"coordsets", "an object of coordsets")?;
    let topologies = node.need(c"topologies", "an object of topologies")?;
    let mut named = Vec::new();
    topologies.each(|topology| {
        let coordset_name = topology.need(c"coordset", "the name of its coordset")?;
        let text = CString::new(&*coordset_name.text()?).unwrap_or_default();
        let Some(coordset_node) = coordsets.child(&text) else {
            let known: Vec<String> =
                coordsets.names().iter().map(|name| name.to_string_lossy().into_owned()).collect();
            return Err(coordset_name.wrong(format!("one of the coordsets {}", known.join(", "))));
        };
        let coordset = coordset::read(&coordset_node)?;
        let cells = topology::read(topology, &coordset)?;
        let name = topology.name().into_owned();
        let of_name = Named { name, coordset: text, topology: cells, dimension: 0 };
        named.push((of_name, coordset));
        Ok(())
    })?;
    if named.len() > 1 {
        for (named, _) in &mut named {
            named.dimension = named.topology.dimension()?;
        }
    }
    // The cells are those of the highest dimension.
    let main = (0..named.len()).rev().max_by_key(|&index| named[index].0.dimension);
    let Some(main) = main else {
        return Err(topologies.wrong("at least one topology"));
    };
    let (main, coordset) = named.swap_remove(main);
    let others: Vec<Named> = named.into_iter().map(|(other, _)| other).collect();
    let mut domain = Domain {
        coordset,
        topology: main.topology.clone(),
        fields: Vec::new(),
        faces: Vec::new(),
        roles: Roles::default(),
        label: Label::Path(node.path()),
    };
    if with_fields {
        // On a rank without cells the topologies may be in another order.
        if domain.topology.cell_count() > 0 {
            let passed_over = others.iter().filter(|other| {
                other.dimension == main.dimension && other.topology.cell_count() > 0
            });
            notes.extend(passed_over.map(|other| {
                let (path, cells) = (topologies.path(), &main.name);
                format!(
                    "'{path}/{}' is passed over: the cells are those of topology '{cells}'",
                    other.name
                )
            }));
        }
        read_fields(&mut domain, node, &main, &others, notes)?;
    }
    Ok(Some(domain))
}

fn read_fields<'call>(
    domain: &mut Domain<'call>,
    node: &Node<'_, 'call>,
    main: &Named,
    others: &[Named<'call>],
    notes: &mut Vec<String>,
) -> Result<(), RunError> {
    let Some(fields) = node.child(c"fields") else { return Ok(()) };
    if fields.kind() == Kind::Empty {
        return Ok(());
    }
    if fields.kind() != Kind::Object {
        return Err(fields.wrong("an object of fields"));
    }
    let (vertices, elements) = (domain.coordset.vertex_count(), domain.topology.cell_count());
    let state = node.child(c"state");
    let metadata = state.as_ref().and_then(|state| state.child(c"metadata"));
    let told = metadata.as_ref().and_then(|metadata| metadata.child(c"vtk_fields"));
    // The topologies of faces whose features are known: the first field that names them holds.
    let mut tagged: Vec<&str> = Vec::new();
    fields.each(|field_node| {
        let other = faces_of(field_node, main, others)?;
        if let Some(other) = other.filter(|other| !tagged.contains(&other.name.as_str())) {
            domain.faces.push(faces(field_node, other)?);
            tagged.push(&other.name);
            return Ok(());
        }
        if let Some(of) = field_node.child(c"topology")
            && let of = of.text()?
            && of != main.name
        {
            let other = others.iter().find(|other| other.name == of);
            // Where there are no cells nothing is lost.
            if elements > 0 && other.is_none_or(|other| other.topology.cell_count() > 0) {
                let (path, cells) = (field_node.path(), &main.name);
                notes.push(format!(
                    "'{path}' is passed over: it is one of topology '{of}', and the cells are those of topology '{cells}'"
                ));
            }
            return Ok(());
        }
        let read = field::read(field_node, &main.name, vertices, elements, notes)?;
        let Some(field) = read else { return Ok(()) };
        let role = told.as_ref().and_then(|told| told.child(field_node.key()));
        let role = match role.as_ref().and_then(|role| role.child(c"attribute_type")) {
            Some(role) => role.text()?.into_owned(),
            None if field.name == GHOST_FIELD => GHOSTS.into(),
            None => String::new(),
        };
        take_role(&mut domain.roles, &field, &role, field_node)?;
        domain.fields.push(if role == GHOSTS { field.of_ghosts() } else { field });
        Ok(())
    })
}

fn take_role<'call>(
    roles: &mut Roles<'call>,
    field: &Field<'call>,
    role: &str,
    node: &Node<'_, 'call>,
) -> Result<(), RunError> {
    let [values] = field.components.as_slice() else { return Ok(()) };
    let is_features = field.name == "features" && field.association == Association::Vertex;
    let slot = match (role, field.association) {
        (GHOSTS, Association::Element) => &mut roles.ghosts,
        ("GlobalIds", Association::Vertex) => &mut roles.global_vertices,
        ("GlobalIds", Association::Element) => &mut roles.global_cells,
        _ if is_features && values.is_integer() => &mut roles.vertex_features,
        _ => return Ok(()),
    };
    if !values.is_integer() {
        return Err(node
            .need(c"values", "integers")?
            .wrong(format!("integers, as it holds {role}")));
    }
    *slot = Some(*values);
    Ok(())
}

/// The topology whose faces' features an element field names: the field is called `features`,
/// `boundary_attribute` or `<topology>_attribute`, and lies on a topology over the same coordinates
/// whose cells are the faces of the main one's.
fn faces_of<'a, 'call>(
    node: &Node<'_, 'call>,
    main: &Named,
    others: &'a [Named<'call>],
) -> Result<Option<&'a Named<'call>>, RunError> {
    let Some(of) = node.child(c"topology") else { return Ok(None) };
    let of = of.text()?;
    let other = others.iter().find(|other| {
        other.name == of
            && other.coordset == main.coordset
            && other.dimension == 2
            && main.dimension == 3
    });
    let name = node.name();
    let names_features =
        name == "features" || name == "boundary_attribute" || name == format!("{of}_attribute");
    Ok(other.filter(|_| names_features))
}

/// The faces of a topology, and the integers that say which feature each belongs to.
fn faces<'call>(node: &Node<'_, 'call>, other: &Named<'call>) -> Result<Faces<'call>, RunError> {
    let values = node.need(c"values", "the number of each face's feature")?;
    let components = field::components(&values)?;
    match components.as_slice() {
        [tags] if tags.is_integer() && tags.len() == other.topology.cell_count() => {
            Ok(Faces { topology: other.topology.clone(), tags: *tags })
        }
        _ => Err(values.wrong(format!(
            "{} integers, one for each face of topology '{}'",
            other.topology.cell_count(),
            other.name
        ))),
    }
}
