//! Fields, and the components of arrays.

use tombolo::foreign::mesh::{COMPONENTS, Field};
use tombolo::foreign::{Array, RunError};
use tombolo::pipelines::extract::Association;

use crate::node::{Kind, Node};

/// The components of a `values` node: an array, or an object (or list) of arrays.
pub(super) fn components<'call>(values: &Node<'_, 'call>) -> Result<Vec<Array<'call>>, RunError> {
    if !matches!(values.kind(), Kind::Object | Kind::List) {
        return Ok(vec![values.array()?]);
    }
    if !(1..=COMPONENTS).contains(&values.len()) {
        return Err(values.wrong(format!("1 to {COMPONENTS} components")));
    }
    let mut components: Vec<Array<'call>> = Vec::with_capacity(values.len());
    values.each(|child| {
        let array = child.array()?;
        if let Some(first) = components.first().filter(|first| first.len() != array.len()) {
            return Err(
                child.wrong(format!("{} values, as many as in the first component", first.len()))
            );
        }
        components.push(array);
        Ok(())
    })?;
    Ok(components)
}

/// Reads a field of this topology; `None` for one without values that could be shown, of which a note
/// says so.
pub(super) fn read<'call>(
    node: &Node<'_, 'call>,
    topology: &str,
    vertices: usize,
    elements: usize,
    notes: &mut Vec<String>,
) -> Result<Option<Field<'call>>, RunError> {
    let Some(association_node) = node.child(c"association") else {
        // Coefficients of a basis, or of a material, are no values at vertices or in elements.
        if node.child(c"basis").is_some() || node.child(c"matset").is_some() {
            return Ok(None);
        }
        return Err(node
            .need(c"association", "'vertex' or 'element'")
            .err()
            .unwrap_or_else(|| node.wrong("a field")));
    };
    let (association, expected) = match &*association_node.text()? {
        "vertex" => (Association::Vertex, vertices),
        "element" => (Association::Element, elements),
        other => {
            return Err(association_node.wrong_found(format!("'{other}'"), "'vertex' or 'element'"));
        }
    };
    if node.child(c"values").is_none() && node.child(c"matset_values").is_some() {
        let path = node.path();
        notes.push(format!("'{path}' is passed over: it has values of materials alone"));
        return Ok(None);
    }
    let values = node.need(c"values", "an array, or an object of components")?;
    let components = components(&values)?;
    let found = components.first().map_or(0, Array::len);
    if found != expected {
        return Err(values.wrong_found(
            format!("{found} values"),
            format!("{expected}, one for each {association} of topology '{}'", topology),
        ));
    }
    Ok(Some(Field::new(node.name().into_owned(), association, components)))
}

/// A field of the mesh as a whole; `None` for a text.
pub(super) fn read_of_mesh<'call>(
    node: &Node<'_, 'call>,
) -> Result<Option<Field<'call>>, RunError> {
    if node.kind() == Kind::Text {
        return Ok(None);
    }
    Ok(Some(Field::new(node.name().into_owned(), Association::Mesh, components(node)?)))
}
