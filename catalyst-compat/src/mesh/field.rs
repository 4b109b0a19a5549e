//! Fields, and arrays of components as the adaptor is lent them.

use std::ffi::CStr;

use tombolo::deform::mesh::{ArrayView, Values};
use tombolo::pipelines::extract::{Association, GHOST_FIELD};

use crate::array::{Array, NumberType};
use crate::error::CatalystError;
use crate::node::{Kind, Node};

/// Most components that a tuple can have.
const COMPONENTS: usize = 9;

/// A field of a mesh.
#[derive(Debug, Clone)]
pub(crate) struct Field<'call> {
    pub(super) name: String,
    pub(super) association: Association,
    pub(super) components: Vec<Array<'call>>,
    /// What files hold it as.
    pub(super) number: NumberType,
}

/// The type of all components; double precision where they differ.
fn number(components: &[Array<'_>]) -> NumberType {
    let first = components.first().map_or(NumberType::F64, Array::number);
    if components.iter().all(|array| array.number() == first) { first } else { NumberType::F64 }
}

/// Components as they lie in the solver's memory, where each can be lent.
pub(super) fn lent<'call>(components: &[Array<'call>]) -> Option<ArrayView<'call>> {
    let mut columns: [(Values<'call>, usize, usize); COMPONENTS] =
        [(Values::U8(&[]), 0, 1); COMPONENTS];
    for (column, array) in columns.iter_mut().zip(components) {
        let (values, stride) = array.values()?;
        *column = (values, 0, stride);
    }
    ArrayView::strided(components.first()?.len(), columns.get(..components.len())?).ok()
}

/// The components of a `values` node: an array, or an object (or list) of arrays.
pub(super) fn components<'call>(
    values: &Node<'_, 'call>,
) -> Result<Vec<Array<'call>>, CatalystError> {
    if !matches!(values.kind(), Kind::Object | Kind::List) {
        return Ok(vec![values.array()?]);
    }
    let names = values.names();
    if names.is_empty() || names.len() > COMPONENTS {
        return Err(values.wrong(format!("1 to {COMPONENTS} components")));
    }
    let mut components: Vec<Array<'call>> = Vec::with_capacity(names.len());
    for (index, name) in names.iter().enumerate() {
        let Some(child) = values.at(index, name) else { continue };
        let array = child.array()?;
        if let Some(first) = components.first().filter(|first| first.len() != array.len()) {
            return Err(
                child.wrong(format!("{} values, as many as in the first component", first.len()))
            );
        }
        components.push(array);
    }
    Ok(components)
}

impl<'call> Field<'call> {
    /// Reads a field of this topology; `None` for one of another topology, or without values that could be shown.
    pub(super) fn read(
        node: &Node<'_, 'call>,
        topology: &CStr,
        vertices: usize,
        elements: usize,
    ) -> Result<Option<Self>, CatalystError> {
        if let Some(of) = node.child(c"topology")
            && of.text()?.as_bytes() != topology.to_bytes()
        {
            return Ok(None);
        }
        let Some(association_node) = node.child(c"association") else {
            // Coefficients of a basis, or of a material, are no values at vertices or in elements.
            if node.child(c"basis").is_some() || node.child(c"matset").is_some() {
                return Ok(None);
            }
            return Err(node
                .need(c"association", "'vertex' or 'element'")
                .err()
                .unwrap_or_else(|| node.wrong("a field".into())));
        };
        let (association, expected) = match &*association_node.text()? {
            "vertex" => (Association::Vertex, vertices),
            "element" => (Association::Element, elements),
            other => {
                return Err(association_node
                    .wrong_found(format!("'{other}'"), "'vertex' or 'element'".into()));
            }
        };
        let values = node.need(c"values", "an array, or an object of components")?;
        let components = components(&values)?;
        let found = components.first().map_or(0, Array::len);
        if found != expected {
            return Err(values.wrong_found(
                format!("{found} values"),
                format!(
                    "{expected}, one for each {association} of topology '{}'",
                    topology.to_string_lossy()
                ),
            ));
        }
        Ok(Some(Self::new(node.name().into_owned(), association, components)))
    }

    /// A field of the mesh as a whole; `None` for a text.
    pub(super) fn read_of_mesh(node: &Node<'_, 'call>) -> Result<Option<Self>, CatalystError> {
        if node.kind() == Kind::Text {
            return Ok(None);
        }
        Ok(Some(Self::new(node.name().into_owned(), Association::Mesh, components(node)?)))
    }

    pub(super) fn new(
        name: String,
        association: Association,
        components: Vec<Array<'call>>,
    ) -> Self {
        Self { name, association, number: number(&components), components }
    }

    /// The field by VTK's name for what says which cells or vertices are ghosts, and of VTK's type.
    pub(super) fn of_ghosts(self) -> Self {
        Self { name: GHOST_FIELD.to_owned(), number: NumberType::U8, ..self }
    }
}
