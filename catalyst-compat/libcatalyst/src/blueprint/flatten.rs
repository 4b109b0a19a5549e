//! A mesh as tables: a row for each vertex and for each element.

use crate::blueprint::domain::{Domain, gather_values};
use crate::blueprint::mesh::domains;
use crate::error::Result;
use crate::node::Node;

/// Makes the tables `vertex_data` and `element_data`: coordinates (of an element, those of its centre), fields, and the number of
/// the domain where there are several. The option `topology` says which; `field_names`, a list, which fields.
///
/// # Errors
/// A domain cannot be read, or the domains' fields differ in type.
pub fn flatten(mesh: &Node, options: &Node) -> Result<Node> {
    let topology = options.get("topology").and_then(Node::text);
    let wanted: Option<Vec<_>> =
        options.get("field_names").map(|names| names.children().filter_map(|(_, name)| name.text()).collect());
    let read: Result<Vec<_>> =
        domains(mesh).into_iter().map(|domain| Domain::read(domain, topology.as_deref())).collect();
    let read = read?;
    let mut tables = Node::new();
    let Some(first) = read.first() else {
        return Ok(tables);
    };
    for (of_vertices, table) in [(true, "vertex_data"), (false, "element_data")] {
        for (axis, (name, _)) in first.axes.iter().enumerate() {
            let column: Vec<f64> = read.iter().flat_map(|domain| coordinates(domain, axis, of_vertices)).collect();
            tables.at(table)?.at("values")?.child_named(name)?.set_numbers(&column)?;
        }
        for (name, at_vertices, _) in &first.fields {
            if *at_vertices != of_vertices || wanted.as_ref().is_some_and(|wanted| !wanted.contains(name)) {
                continue;
            }
            let mut rows = Vec::new();
            for domain in &read {
                let count = if of_vertices { domain.points() } else { domain.elements.len() };
                let field = domain.fields.iter().find(|(known, ..)| known == name);
                let values = field.and_then(|(_, _, field)| field.get("values"));
                rows.extend(values.into_iter().flat_map(|values| (0..count).map(move |row| (values, row))));
            }
            tables.at(table)?.at("values")?.child_named(name)?.take(gather_values(&rows)?)?;
        }
        if read.len() > 1 {
            let count = |domain: &Domain<'_>| if of_vertices { domain.points() } else { domain.elements.len() };
            let numbers = read.iter().enumerate().flat_map(|(index, domain)| vec![index; count(domain)]);
            let numbers: Vec<i64> = numbers.map(|index| i64::try_from(index).unwrap_or(i64::MAX)).collect();
            tables.at(table)?.at("values/domain_id")?.set_numbers(&numbers)?;
        }
    }
    Ok(tables)
}

#[expect(clippy::cast_precision_loss, reason = "no element has so many vertices")]
fn coordinates(domain: &Domain<'_>, axis: usize, of_vertices: bool) -> Vec<f64> {
    let Some((_, values)) = domain.axes.get(axis) else {
        return Vec::new();
    };
    if of_vertices {
        return values.clone();
    }
    let centre =
        |vertices: &[usize]| vertices.iter().map(|vertex| values[*vertex]).sum::<f64>() / vertices.len().max(1) as f64;
    domain.elements.iter().map(|element| centre(&element.vertices)).collect()
}
