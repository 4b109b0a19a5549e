//! One mesh of the Blueprint: a topology with its coordinates, its fields and its features.

use std::ffi::{CStr, CString};

use tombolo::pipelines::extract::{Association, GHOST_FIELD};

use super::coordset::Coordset;
use super::field::{self, Field};
use super::topology::Topology;
use crate::array::{Array, Fingerprint};
use crate::error::CatalystError;
use crate::memory;
use crate::node::{Kind, Node};

/// What ParaView's Catalyst calls the field that says which cells or vertices are copies of another rank's.
const GHOSTS: &str = "Ghosts";

/// What a field says besides its values.
#[derive(Debug, Clone, Default)]
pub(super) struct Roles<'call> {
    pub(super) ghosts: Option<Array<'call>>,
    pub(super) global_vertices: Option<Array<'call>>,
    pub(super) global_cells: Option<Array<'call>>,
    pub(super) vertex_features: Option<Array<'call>>,
}

/// Faces with the number of their feature.
#[derive(Debug, Clone)]
pub(super) struct Faces<'call> {
    pub(super) topology: Topology<'call>,
    pub(super) tags: Array<'call>,
}

/// A mesh.
#[derive(Debug, Clone)]
pub(super) struct Domain<'call> {
    pub(super) coordset: Coordset<'call>,
    pub(super) topology: Topology<'call>,
    pub(super) fields: Vec<Field<'call>>,
    /// Faces of one type each.
    pub(super) faces: Vec<Faces<'call>>,
    pub(super) roles: Roles<'call>,
    path: String,
}

/// A topology and what it is called.
struct Named<'call> {
    name: CString,
    coordset: CString,
    topology: Topology<'call>,
}

impl<'call> Domain<'call> {
    /// Reads a mesh; `None` for one that says nothing, as that of a rank without cells may.
    pub(super) fn read(
        node: &Node<'_, 'call>,
        with_fields: bool,
    ) -> Result<Option<Self>, CatalystError> {
        if node.kind() == Kind::Empty || (node.kind() == Kind::Object && node.len() == 0) {
            return Ok(None);
        }
        let coordsets = node.need(c"coordsets", "an object of coordsets")?;
        let topologies = node.need(c"topologies", "an object of topologies")?;
        let mut named = Vec::new();
        for (index, name) in topologies.names().into_iter().enumerate() {
            let Some(topology) = topologies.at(index, &name) else { continue };
            let coordset_name = topology.need(c"coordset", "the name of its coordset")?;
            let text = CString::new(&*coordset_name.text()?).unwrap_or_default();
            let Some(coordset_node) = coordsets.child(&text) else {
                let known: Vec<String> = coordsets
                    .names()
                    .iter()
                    .map(|name| name.to_string_lossy().into_owned())
                    .collect();
                return Err(
                    coordset_name.wrong(format!("one of the coordsets {}", known.join(", ")))
                );
            };
            let coordset = Coordset::read(&coordset_node)?;
            let cells = Topology::read(&topology, &coordset)?;
            named.push((
                Named { name: name.clone(), coordset: text.clone(), topology: cells },
                coordset,
            ));
        }
        // The cells are those of the highest dimension.
        let main = (0..named.len()).rev().max_by_key(|&index| named[index].0.topology.dimension());
        let Some(main) = main else {
            return Err(topologies.wrong("at least one topology".into()));
        };
        let (main, coordset) = named.swap_remove(main);
        let others: Vec<Named> = named.into_iter().map(|(other, _)| other).collect();
        let mut domain = Self {
            coordset,
            topology: main.topology.clone(),
            fields: Vec::new(),
            faces: Vec::new(),
            roles: Roles::default(),
            path: node.path(),
        };
        if with_fields {
            domain.read_fields(node, &main, &others)?;
        }
        Ok(Some(domain))
    }

    /// A mesh whose parts are known, and what to call it in errors.
    pub(super) fn described(
        coordset: Coordset<'call>,
        topology: Topology<'call>,
        fields: Vec<Field<'call>>,
        faces: Vec<Faces<'call>>,
        roles: Roles<'call>,
        path: String,
    ) -> Self {
        Self { coordset, topology, fields, faces, roles, path }
    }

    fn read_fields(
        &mut self,
        node: &Node<'_, 'call>,
        main: &Named,
        others: &[Named<'call>],
    ) -> Result<(), CatalystError> {
        let Some(fields) = node.child(c"fields") else { return Ok(()) };
        if fields.kind() == Kind::Empty {
            return Ok(());
        }
        if fields.kind() != Kind::Object {
            return Err(fields.wrong("an object of fields".into()));
        }
        let (vertices, elements) = (self.coordset.len(), self.topology.len());
        let state = node.child(c"state");
        let metadata = state.as_ref().and_then(|state| state.child(c"metadata"));
        let told = metadata.as_ref().and_then(|metadata| metadata.child(c"vtk_fields"));
        for (index, name) in fields.names().iter().enumerate() {
            let Some(field_node) = fields.at(index, name) else { continue };
            if self.faces.is_empty() {
                self.faces.extend(faces(&field_node, name, main, others)?);
            }
            let Some(field) = Field::read(&field_node, &main.name, vertices, elements)? else {
                continue;
            };
            let role = told.as_ref().and_then(|told| told.child(name));
            let role = match role.as_ref().and_then(|role| role.child(c"attribute_type")) {
                Some(role) => role.text()?.into_owned(),
                None if field.name == GHOST_FIELD => GHOSTS.into(),
                None => String::new(),
            };
            self.take_role(&field, &role, &field_node)?;
            self.fields.push(if role == GHOSTS { field.of_ghosts() } else { field });
        }
        Ok(())
    }

    fn take_role(
        &mut self,
        field: &Field<'call>,
        role: &str,
        node: &Node<'_, 'call>,
    ) -> Result<(), CatalystError> {
        let [values] = field.components.as_slice() else { return Ok(()) };
        let is_features = field.name == "features" && field.association == Association::Vertex;
        let slot = match (role, field.association) {
            (GHOSTS, Association::Element) => &mut self.roles.ghosts,
            ("GlobalIds", Association::Vertex) => &mut self.roles.global_vertices,
            ("GlobalIds", Association::Element) => &mut self.roles.global_cells,
            _ if is_features && values.is_integer() => &mut self.roles.vertex_features,
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

    /// Takes what makes these cells other cells into a fingerprint; values that change from step to step are not among it.
    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        self.coordset.fingerprint(into);
        self.topology.fingerprint(into);
        for faces in &self.faces {
            faces.topology.fingerprint(into);
            faces.tags.fingerprint(into);
        }
        let Roles { ghosts, global_vertices, global_cells, vertex_features } = &self.roles;
        for array in [ghosts, global_vertices, global_cells, vertex_features].into_iter().flatten()
        {
            array.fingerprint(into);
        }
    }

    /// Refuses arrays whose memory cannot be read.
    pub(super) fn check_memory(&self) -> Result<(), CatalystError> {
        let of_faces = self
            .faces
            .iter()
            .flat_map(|faces| faces.topology.arrays().into_iter().chain([&faces.tags]));
        let of_fields = self.fields.iter().flat_map(|field| {
            field
                .components
                .iter()
                .map(move |array| (array, format_args!("fields/{}/values", field.name).to_string()))
        });
        let coordsets = self.coordset.arrays().iter().map(|array| (array, "coordsets".to_owned()));
        let topologies = self
            .topology
            .arrays()
            .into_iter()
            .chain(of_faces)
            .map(|array| (array, "topologies".to_owned()));
        for (array, place) in coordsets.chain(topologies).chain(of_fields) {
            if let Some(found) = memory::fault(array) {
                return Err(CatalystError::Wrong {
                    path: format!("{}/{place}", self.path),
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

/// The faces whose features an element field names: one of integers, called `features`, `boundary_attribute` or
/// `<topology>_attribute`, on a topology over the same coordinates whose cells are the faces of the main one's.
fn faces<'call>(
    node: &Node<'_, 'call>,
    name: &CStr,
    main: &Named,
    others: &[Named<'call>],
) -> Result<Option<Faces<'call>>, CatalystError> {
    let Some(of) = node.child(c"topology") else { return Ok(None) };
    let of = of.text()?;
    let other = others.iter().find(|other| {
        other.name.to_bytes() == of.as_bytes()
            && other.coordset == main.coordset
            && other.topology.dimension() == 2
            && main.topology.dimension() == 3
    });
    let Some(other) = other else { return Ok(None) };
    let name = name.to_string_lossy();
    if name != "features" && name != "boundary_attribute" && name != format!("{of}_attribute") {
        return Ok(None);
    }
    let values = node.need(c"values", "the number of each face's feature")?;
    let components = field::components(&values)?;
    match components.as_slice() {
        [tags] if tags.is_integer() && tags.len() == other.topology.len() => {
            Ok(Some(Faces { topology: other.topology.clone(), tags: *tags }))
        }
        _ => Err(values.wrong(format!(
            "{} integers, one for each face of topology '{of}'",
            other.topology.len()
        ))),
    }
}
