//! Tables, and arrays that zfp has compressed.

use crate::blueprint::mcarray;
use crate::blueprint::report::{Report, described};
use crate::datatype::Kind;
use crate::node::Node;

/// Verifies a table (`values` with columns of one length), or an object or list of tables.
pub fn verify(node: &Node, report: &mut Report) {
    if !matches!(node.kind(), Kind::Object | Kind::List) || node.count() == 0 {
        return report
            .wrong(node, &format!("a table, or several, is expected, not {}", described(node)));
    }
    if node.get("values").is_some() {
        return verify_one(node, report);
    }
    for (index, (name, table)) in node.children().enumerate() {
        let name = if name.is_empty() { format!("[{index}]") } else { name.to_owned() };
        let below = report.below(&name, "table");
        if below.needed(table, "values").is_some() {
            verify_one(table, below);
        }
    }
    if report.is_valid() {
        report.count("tables", i64::try_from(node.count()).unwrap_or(i64::MAX));
    }
}

fn verify_one(table: &Node, report: &mut Report) {
    let Some(values) = table.get("values") else {
        return;
    };
    if !matches!(values.kind(), Kind::Object | Kind::List) || values.count() == 0 {
        return report.wrong(values, &format!("columns are expected, not {}", described(values)));
    }
    let mut rows = None;
    let of_values = report.below("values", "table");
    for (index, (name, column)) in values.children().enumerate() {
        let name = if name.is_empty() { format!("[{index}]") } else { name.to_owned() };
        let below = of_values.below(&name, "table");
        mcarray::verify_values(column, below);
        let length = column.child(0).unwrap_or(column).datatype().elements;
        let expected = *rows.get_or_insert(length);
        if length != expected {
            below.wrong(column, &format!("{length} rows, where the first column has {expected}"));
        }
        if below.is_valid() {
            below.count("elements", length);
        }
    }
    if of_values.is_valid() {
        of_values.count("columns", i64::try_from(values.count()).unwrap_or(i64::MAX));
        of_values.count("rows", rows.unwrap_or(0));
    }
}

/// Verifies an array that zfp has compressed: `zfpa`, its stream.
pub fn verify_compressed(node: &Node, report: &mut Report) {
    if let Some(stream) = report.needed(node, "zfpa").filter(|stream| !stream.kind().is_unsigned())
    {
        report.wrong(stream, &format!("unsigned integers are expected, not {}", described(stream)));
    }
}
