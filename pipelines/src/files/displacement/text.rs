//! Displacements as plain text.

use std::fmt::Write as _;

use tombolo_deform::mesh::Vector;
use tombolo_deform::surface::Surface;

use super::matching::Matcher;
use super::{SurfaceDisplacement, VERTEX};
use crate::files::Problem;
use crate::files::error::{Flaw, Position};

/// The contents of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Vertex,
    Point(usize),
    Value(usize),
    Other,
}

const BY_POINT: [Column; 6] = [
    Column::Point(0),
    Column::Point(1),
    Column::Point(2),
    Column::Value(0),
    Column::Value(1),
    Column::Value(2),
];
const BY_VERTEX: [Column; 4] =
    [Column::Vertex, Column::Value(0), Column::Value(1), Column::Value(2)];

/// Reads the displacement of vertices from the bytes of a text.
pub(super) fn parse_text(bytes: &[u8], surface: &Surface) -> Result<SurfaceDisplacement, Flaw> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = bytes.get(..error.valid_up_to()).unwrap_or(bytes);
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        let problem =
            Problem::unexpected(bytes.get(error.valid_up_to()..).unwrap_or(&[]), "text (UTF-8)");
        Flaw { position: Position::Line(line), problem }
    })?;
    let mut matcher = Matcher::new(surface);
    let mut columns: Option<Vec<Column>> = None;
    for (number, line) in text.lines().enumerate() {
        let words = words(line);
        let Some(&(first_at, first)) = words.first() else { continue };
        let flaw = |at: usize, problem: Problem| Flaw {
            position: Position::Column { line: number + 1, column: at },
            problem,
        };
        let columns = match &columns {
            Some(columns) => columns,
            None if first.parse::<f64>().is_err()
                && !first.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) =>
            {
                columns = Some(header(&words).map_err(|problem| flaw(first_at, problem))?);
                continue;
            }
            None => columns.insert(match words.len() {
                6 => BY_POINT.to_vec(),
                4 => BY_VERTEX.to_vec(),
                found => {
                    let expected =
                        "6 (x y z dx dy dz), 4 (vertex dx dy dz), or a line that names them";
                    return Err(flaw(
                        first_at,
                        Problem::wrong(format!("{found} columns"), expected),
                    ));
                }
            }),
        };
        if words.len() != columns.len() {
            // The first word too many, or the end of the line.
            let at = words.get(columns.len()).map_or(line.chars().count() + 1, |(at, _)| *at);
            let expected = format!("{} as in the lines before", columns.len());
            return Err(flaw(at, Problem::wrong(format!("{} columns", words.len()), expected)));
        }
        let (mut vertex, mut point, mut value) = (None, None, [0.0; 3]);
        for (&(at, word), column) in words.iter().zip(columns) {
            let number = || match word.parse::<f64>() {
                Ok(number) if number.is_finite() => Ok(number),
                _ => Err(flaw(at, Problem::unexpected(word.as_bytes(), "a finite number"))),
            };
            match *column {
                Column::Vertex => {
                    let expected = "a mesh vertex number, counted from 0";
                    let number = word.parse::<u32>();
                    vertex =
                        Some(number.map_err(|_| {
                            flaw(at, Problem::unexpected(word.as_bytes(), expected))
                        })?);
                }
                Column::Point(axis) => point.get_or_insert([0.0; 3])[axis] = number()?,
                Column::Value(axis) => value[axis] = number()?,
                Column::Other => {}
            }
        }
        matcher.take(vertex, point, value).map_err(|problem| flaw(first_at, problem))?;
    }
    matcher.finish()
}

/// The words of a line, parted by commas and blanks, each with its column counted from 1; what
/// follows a `#` is a comment.
fn words(line: &str) -> Vec<(usize, &str)> {
    let mut words = Vec::new();
    let mut start: Option<(usize, usize)> = None;
    let mut quoted = false;
    let mut end = line.len();
    for (column, (byte, character)) in line.char_indices().enumerate() {
        if character == '#' && !quoted {
            end = byte;
            break;
        }
        if character == '"' {
            quoted = !quoted;
        }
        let parts = !quoted && (character == ',' || character.is_whitespace());
        match (parts, start) {
            (true, Some((first, column))) => {
                words.push((column, line[first..byte].trim_matches('"')));
                start = None;
            }
            (false, None) => start = Some((byte, column + 1)),
            _ => {}
        }
    }
    if let Some((first, column)) = start {
        words.push((column, line[first..end].trim_matches('"')));
    }
    words
}

fn header(words: &[(usize, &str)]) -> Result<Vec<Column>, Problem> {
    let columns: Vec<Column> = words.iter().map(|(_, word)| column(word)).collect();
    let has = |column: Column| columns.iter().filter(|found| **found == column).count();
    let points = [0, 1, 2].map(|axis| has(Column::Point(axis)));
    let values = [0, 1, 2].map(|axis| has(Column::Value(axis)));
    let names_points = points == [1; 3] || (points == [0; 3] && has(Column::Vertex) == 1);
    if values == [1; 3] && names_points && has(Column::Vertex) <= 1 {
        return Ok(columns);
    }
    let listed: Vec<&str> = words.iter().map(|(_, word)| *word).collect();
    let expected = "each of dx, dy, dz and either vertex or each of x, y, z once";
    Err(Problem::wrong(format!("the columns {}", listed.join(", ")), expected))
}

fn column(word: &str) -> Column {
    let word = word.to_ascii_lowercase();
    let axis = |prefix: &str, axes: [&str; 3]| {
        word.strip_prefix(prefix).and_then(|rest| axes.iter().position(|axis| *axis == rest))
    };
    if word == VERTEX {
        return Column::Vertex;
    }
    for (prefix, axes) in
        [("", ["x", "y", "z"]), ("points:", ["0", "1", "2"]), ("points_", ["0", "1", "2"])]
    {
        if let Some(axis) = axis(prefix, axes) {
            return Column::Point(axis);
        }
    }
    for (prefix, axes) in [
        ("d", ["x", "y", "z"]),
        ("displacement:", ["0", "1", "2"]),
        ("displacement_", ["0", "1", "2"]),
    ] {
        if let Some(axis) = axis(prefix, axes) {
            return Column::Value(axis);
        }
    }
    Column::Other
}

/// Writes displacements as a text: by coordinates, which other programs understand too, or by
/// vertex numbers where two vertices cannot be told apart by them.
pub(super) fn to_text(surface: &Surface, displacement: &[Vector], comma: &str) -> String {
    let mut matcher = Matcher::new(surface);
    let alone = surface.points().iter().all(|&point| !matcher.has_neighbour(point));
    let mut text =
        String::from("# displacement of the vertices of a surface, from the reference mesh\n");
    let names: &[&str] =
        if alone { &["x", "y", "z", "dx", "dy", "dz"] } else { &["vertex", "dx", "dy", "dz"] };
    text.push_str(&names.join(comma));
    text.push('\n');
    for ((point, vertex), value) in
        surface.points().iter().zip(surface.vertices()).zip(displacement)
    {
        let name: Vec<String> = if alone {
            point.iter().map(|part| format!("{part:?}")).collect()
        } else {
            vec![vertex.to_string()]
        };
        let value = value.iter().map(|part| format!("{part:?}"));
        let row: Vec<String> = name.into_iter().chain(value).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", row.join(comma));
    }
    text
}
