//! Displacement files: what the vertices of a surface are moved by, as plain text or VTK.
//!
//! # Plain text
//! One line for each vertex that moves, its numbers parted by commas or blanks. A `#` begins a comment; empty lines are passed
//! over. Either of
//!
//! | columns | the vertex is found |
//! |---|---|
//! | `x y z dx dy dz` | by its reference coordinates, within [`TOLERANCE`] |
//! | `vertex dx dy dz` | by its mesh vertex number, counted from 0 |
//!
//! A first line of words names the columns, in any order; columns with other names are then passed over. Beside the names above
//! it may have those of ParaView's tables (`Points:0`, `displacement:0` and so on). A header may name both the vertex and its
//! coordinates, which are then checked.
//!
//! # VTK
//! A `.vtp`, `.vtu` or `.vtk` file whose points have an array `displacement` of three components. Points are found by their
//! coordinates, or by the point array `vertex` where the file has it. Points inside a volume are passed over.
//!
//! # Both
//! Vertices that the file does not name do not move. A point that is no vertex of the surface is an error, and so is a vertex that
//! stands twice.

use std::collections::HashMap;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

use tombolo_deform::mesh::{NumberType, Vector};
use tombolo_deform::surface::{Edit, FeatureSettings, Surface};

use super::error::{Flaw, Place};
use super::{
    FileError, Problem, extension, parse_mesh, unknown_extension, write, write_atomically,
};
use crate::extract::{Association, Extract, ExtractFeatures, Field};

/// How far a point of a file may lie from the vertex that it stands for, in diagonals of the surface's bounding box or in the
/// largest coordinate, whichever is more. The nearest vertex is taken.
pub const TOLERANCE: f64 = 1e-6;

const KNOWN: &str = ".txt, .csv, .vtp, .vtu and .vtk";
/// The point array with the displacement.
const DISPLACEMENT: &str = "displacement";
/// The point array with the mesh vertex numbers.
const VERTEX: &str = "vertex";

/// What some vertices of a surface are moved by.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceDisplacement {
    /// The vertices, by mesh vertex numbers; each once.
    pub vertices: Vec<u32>,
    /// How far each of them moves along x, y and z.
    pub values: Vec<Vector>,
}

/// Reads what the vertices of `surface` are moved by from a `.txt`, `.csv`, `.vtp`, `.vtu` or `.vtk` file.
///
/// # Errors
/// [`FileError`] with the line and column, or the point, that is wrong.
///
/// ```
/// use tombolo_deform::{shapes::box_of_tets, surface::{FeatureSettings, Surface}};
/// use tombolo_pipelines::files::{read_displacement, write_displacement};
///
/// let surface = Surface::extract(&box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]), &FeatureSettings::default())?;
/// let folder = tempfile::tempdir()?;
/// let file = folder.path().join("lift.txt");
/// std::fs::write(&file, "# the two lower corners in front\nx, y, z, dx, dy, dz\n0, 0, 0, 0, 0, 0.1\n1, 0, 0, 0, 0, 0.2\n")?;
/// assert_eq!(read_displacement(&file, &surface)?.values, [[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]);
///
/// let all = vec![[0.5, 0.25, 1.0 / 3.0]; surface.points().len()];
/// write_displacement(&file, &surface, &all)?;
/// assert_eq!(read_displacement(&file, &surface)?.values, all);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_displacement(
    path: impl AsRef<Path>,
    surface: &Surface,
) -> Result<SurfaceDisplacement, FileError> {
    let path = path.as_ref();
    is_text(path)?;
    let bytes = std::fs::read(path).map_err(|error| Flaw::from(error).in_file(path))?;
    parse_displacement(path, &bytes, surface)
}

/// As [`read_displacement`], from the bytes of a file; its name tells the format.
///
/// # Errors
/// As [`read_displacement`].
pub fn parse_displacement(
    name: &Path,
    bytes: &[u8],
    surface: &Surface,
) -> Result<SurfaceDisplacement, FileError> {
    let found = if is_text(name)? {
        parse_text(bytes, surface)
    } else {
        let file = parse_mesh(name, bytes)?;
        from_mesh(&file.mesh, &file.fields, surface)
    };
    found.map_err(|flaw| flaw.in_file(name))
}

/// Writes what each vertex of a surface is moved by, so that [`read_displacement`] gives the same bits again: as `.txt` or `.csv`,
/// or as `.vtp` with the reference surface, its features, and the point arrays `displacement` and `vertex`.
///
/// # Errors
/// [`FileError`] for another extension, where `displacement` has not one value for each surface vertex, and where the file cannot be
/// written.
pub fn write_displacement(
    path: impl AsRef<Path>,
    surface: &Surface,
    displacement: &[Vector],
) -> Result<(), FileError> {
    let path = path.as_ref();
    if displacement.len() != surface.points().len() {
        let what = "the values of the displacement".to_owned();
        let (found, expected) = (displacement.len() as u64, surface.points().len() as u64);
        return Err(Flaw::from(Problem::Count { what, found, expected }).in_file(path));
    }
    check_displacement_name(path)?;
    if extension(path) == "vtp" {
        return write(path, &to_extract(surface, displacement));
    }
    let text = to_text(surface, displacement, if extension(path) == "csv" { "," } else { " " });
    write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// Whether [`write_displacement`] takes a file of this name: for whoever wants to know before long work.
///
/// # Errors
/// [`FileError`] for another extension.
pub fn check_displacement_name(path: impl AsRef<Path>) -> Result<(), FileError> {
    let path = path.as_ref();
    match extension(path).as_str() {
        "txt" | "csv" | "vtp" => Ok(()),
        found => Err(unknown_extension(found, ".txt, .csv and .vtp").in_file(path)),
    }
}

/// Reads the files that edits name, and puts what they hold in their place: vertices and values.
///
/// # Errors
/// [`UnreadFile`] with the edit; the edits before it have been read.
pub fn read_displacements(edits: &mut [Edit], surface: &Surface) -> Result<(), UnreadFile> {
    for (edit, what) in edits.iter_mut().enumerate() {
        if let Edit::Displacement(import) = what
            && let Some(file) = &import.file
        {
            let found =
                read_displacement(file, surface).map_err(|source| UnreadFile { edit, source })?;
            (import.file, import.vertices, import.values) = (None, found.vertices, found.values);
        }
    }
    Ok(())
}

/// A displacement file that an edit names and that could not be read.
#[derive(Debug, thiserror::Error)]
#[error("edit {edit} (displacement): file: {source}")]
pub struct UnreadFile {
    /// The place of the edit in its list, counted from 0.
    pub edit: usize,
    /// What is wrong with the file.
    pub source: FileError,
}

fn is_text(path: &Path) -> Result<bool, FileError> {
    match extension(path).as_str() {
        "txt" | "csv" => Ok(true),
        "vtp" | "vtu" | "vtk" => Ok(false),
        found => Err(unknown_extension(found, KNOWN).in_file(path)),
    }
}

/// What a column of a text holds.
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

fn parse_text(bytes: &[u8], surface: &Surface) -> Result<SurfaceDisplacement, Flaw> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = bytes.get(..error.valid_up_to()).unwrap_or(bytes);
        let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
        let problem =
            Problem::unexpected(bytes.get(error.valid_up_to()..).unwrap_or(&[]), "text (UTF-8)");
        Flaw { place: Place::Line(line), problem }
    })?;
    let mut matcher = Matcher::new(surface);
    let mut columns: Option<Vec<Column>> = None;
    for (number, line) in text.lines().enumerate() {
        let words = words(line);
        let Some(&(first_at, first)) = words.first() else { continue };
        let flaw = |at: usize, problem: Problem| Flaw {
            place: Place::Column { line: number + 1, column: at },
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
                        "6 (x y z dx dy dz), 4 (vertex dx dy dz), or a line that names them"
                            .to_owned();
                    return Err(flaw(
                        first_at,
                        Problem::Unexpected { found: format!("{found} columns"), expected },
                    ));
                }
            }),
        };
        if words.len() != columns.len() {
            // The first word too many, or the end of the line.
            let at = words.get(columns.len()).map_or(line.chars().count() + 1, |(at, _)| *at);
            let expected = format!("{} as in the lines before", columns.len());
            return Err(flaw(
                at,
                Problem::Unexpected { found: format!("{} columns", words.len()), expected },
            ));
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

/// The words of a line, parted by commas and blanks, each with its column counted from 1; what follows a `#` is a comment.
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
    let listed = || words.iter().map(|(_, word)| *word).collect::<Vec<_>>().join(", ");
    let points = [0, 1, 2].map(|axis| has(Column::Point(axis)));
    let values = [0, 1, 2].map(|axis| has(Column::Value(axis)));
    let places_well = points == [1; 3] || (points == [0; 3] && has(Column::Vertex) == 1);
    if values == [1; 3] && places_well && has(Column::Vertex) <= 1 {
        return Ok(columns);
    }
    Err(Problem::Unexpected {
        found: format!("the columns {}", listed()),
        expected: "each of dx, dy, dz and either vertex or each of x, y, z once".into(),
    })
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

fn from_mesh(
    mesh: &tombolo_deform::mesh::Mesh,
    fields: &[Field],
    surface: &Surface,
) -> Result<SurfaceDisplacement, Flaw> {
    let find = |name: &str, components: usize| {
        let fits = |field: &&Field| {
            field.name == name
                && field.association == Association::Vertex
                && field.components == components
        };
        fields.iter().find(fits)
    };
    let Some(values) = find(DISPLACEMENT, 3) else {
        let listed = fields
            .iter()
            .map(|field| {
                format!("{} ({} of {} components)", field.name, field.association, field.components)
            })
            .collect::<Vec<_>>()
            .join(", ");
        return Err(Flaw::from(Problem::Unexpected {
            found: if listed.is_empty() {
                "no arrays".into()
            } else {
                format!("the arrays {listed}")
            },
            expected: "a point array `displacement` of 3 components".into(),
        }));
    };
    let numbers = find(VERTEX, 1);
    // Of a volume, what lies inside has no vertex of the surface to stand for.
    let outside = if mesh.cells().dimension() == 3 {
        let outer = Surface::extract(mesh, &FeatureSettings::default()).map_err(|error| {
            Flaw::from(Problem::Unexpected {
                found: error.to_string(),
                expected: "a mesh with a surface".into(),
            })
        })?;
        let mut outside = vec![false; mesh.points().len()];
        outer.vertices().iter().for_each(|&vertex| outside[vertex as usize] = true);
        outside
    } else {
        vec![true; mesh.points().len()]
    };
    let mut matcher = Matcher::new(surface);
    for (index, ((point, value), outside)) in
        mesh.points().iter().zip(values.values.chunks_exact(3)).zip(outside).enumerate()
    {
        if !outside {
            continue;
        }
        let in_point = |problem: Problem| match problem {
            Problem::Unexpected { found, expected } => Flaw::from(Problem::Unexpected {
                found: format!("at point {index}: {found}"),
                expected,
            }),
            other => Flaw::from(other),
        };
        let value = [value[0], value[1], value[2]];
        if value.iter().any(|part| !part.is_finite()) {
            let found = format!("the displacement {value:?}");
            return Err(in_point(Problem::Unexpected { found, expected: "finite numbers".into() }));
        }
        let vertex = match numbers.and_then(|numbers| numbers.values.get(index)) {
            None => None,
            Some(&number)
                if number >= 0.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0 =>
            {
                Some(number as u32)
            }
            Some(number) => {
                let found = format!("the vertex {number}");
                return Err(in_point(Problem::Unexpected {
                    found,
                    expected: "a mesh vertex number".into(),
                }));
            }
        };
        matcher.take(vertex, Some(*point), value).map_err(in_point)?;
    }
    matcher.finish()
}

/// Finds the surface vertices that a file speaks of.
struct Matcher<'a> {
    surface: &'a Surface,
    tolerance: f64,
    /// The surface vertices in each cube of twice the tolerance; made when it is first needed.
    cubes: Option<HashMap<[i64; 3], Vec<u32>>>,
    taken: Vec<bool>,
    found: SurfaceDisplacement,
}

impl<'a> Matcher<'a> {
    fn new(surface: &'a Surface) -> Self {
        let mut lower = [f64::INFINITY; 3];
        let mut upper = [f64::NEG_INFINITY; 3];
        for point in surface.points() {
            for axis in 0..3 {
                lower[axis] = lower[axis].min(point[axis]);
                upper[axis] = upper[axis].max(point[axis]);
            }
        }
        let diagonal = (0..3).fold(0.0f64, |length, axis| length.hypot(upper[axis] - lower[axis]));
        let largest =
            lower.iter().chain(&upper).fold(0.0f64, |largest, value| largest.max(value.abs()));
        let tolerance =
            (TOLERANCE * diagonal.max(largest)).clamp(f64::MIN_POSITIVE, f64::MAX / 4.0);
        let taken = vec![false; surface.points().len()];
        Self { surface, tolerance, cubes: None, taken, found: SurfaceDisplacement::default() }
    }

    fn cube(&self, point: Vector) -> [i64; 3] {
        point.map(|value| (value / (2.0 * self.tolerance)).floor() as i64)
    }

    /// The surface vertices within the tolerance of a point, with their distances.
    fn near(&mut self, point: Vector) -> Vec<(f64, u32)> {
        if self.cubes.is_none() {
            let mut cubes: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
            for (vertex, &at) in self.surface.points().iter().enumerate() {
                cubes.entry(self.cube(at)).or_default().push(vertex as u32);
            }
            self.cubes = Some(cubes);
        }
        let center = self.cube(point);
        let mut near = Vec::new();
        for offset in 0..27 {
            let steps = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
            let cube = [0, 1, 2].map(|axis| center[axis].saturating_add(steps[axis]));
            for &vertex in
                self.cubes.as_ref().and_then(|cubes| cubes.get(&cube)).into_iter().flatten()
            {
                let distance = distance(self.surface.points()[vertex as usize], point);
                if distance <= self.tolerance && !near.contains(&(distance, vertex)) {
                    near.push((distance, vertex));
                }
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near
    }

    fn take(
        &mut self,
        vertex: Option<u32>,
        point: Option<Vector>,
        value: Vector,
    ) -> Result<(), Problem> {
        let local = match (vertex, point) {
            (Some(vertex), point) => {
                let Ok(local) = self.surface.vertices().binary_search(&vertex) else {
                    let found = format!("vertex {vertex}");
                    return Err(Problem::Unexpected {
                        found,
                        expected: "a mesh vertex on the surface".into(),
                    });
                };
                let there = self.surface.points()[local];
                if let Some(point) = point.filter(|point| distance(*point, there) > self.tolerance)
                {
                    let found = format!("vertex {vertex} at {point:?}");
                    return Err(Problem::Unexpected {
                        found,
                        expected: format!("its reference coordinates {there:?}"),
                    });
                }
                local
            }
            (None, Some(point)) => match self.near(point).first() {
                Some(&(_, local)) => local as usize,
                None => {
                    let points = self.surface.points().iter();
                    let nearest =
                        points.map(|at| distance(*at, point)).fold(f64::INFINITY, f64::min);
                    return Err(Problem::Unexpected {
                        found: format!(
                            "the point {point:?}, which is {nearest:e} from the nearest vertex"
                        ),
                        expected: format!(
                            "a vertex of the reference surface, within {:e}",
                            self.tolerance
                        ),
                    });
                }
            },
            // A line without a place is refused with its header.
            (None, None) => return Ok(()),
        };
        let vertex = self.surface.vertices()[local];
        if std::mem::replace(&mut self.taken[local], true) {
            return Err(Problem::Unexpected {
                found: format!("vertex {vertex} again"),
                expected: "each vertex once".into(),
            });
        }
        self.found.vertices.push(vertex);
        self.found.values.push(value);
        Ok(())
    }

    fn finish(self) -> Result<SurfaceDisplacement, Flaw> {
        if self.found.vertices.is_empty() {
            let expected = "the displacement of at least one vertex".into();
            return Err(Flaw::from(Problem::Unexpected { found: "no vertices".into(), expected }));
        }
        Ok(self.found)
    }
}

fn distance(a: Vector, b: Vector) -> f64 {
    (0..3).fold(0.0f64, |length, axis| length.hypot(a[axis] - b[axis]))
}

/// By coordinates, which other programs understand too; by vertex numbers where two vertices lie in the same place.
fn to_text(surface: &Surface, displacement: &[Vector], comma: &str) -> String {
    use std::fmt::Write as _;
    let mut matcher = Matcher::new(surface);
    let alone = surface.points().iter().all(|&point| matcher.near(point).len() == 1);
    let mut text =
        String::from("# displacement of the vertices of a surface, from the reference mesh\n");
    let names: &[&str] =
        if alone { &["x", "y", "z", "dx", "dy", "dz"] } else { &["vertex", "dx", "dy", "dz"] };
    text.push_str(&names.join(comma));
    text.push('\n');
    for ((point, vertex), value) in
        surface.points().iter().zip(surface.vertices()).zip(displacement)
    {
        let place: Vec<String> = if alone {
            point.iter().map(|part| format!("{part:?}")).collect()
        } else {
            vec![vertex.to_string()]
        };
        let value = value.iter().map(|part| format!("{part:?}"));
        let row: Vec<String> = place.into_iter().chain(value).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", row.join(comma));
    }
    text
}

fn to_extract(surface: &Surface, displacement: &[Vector]) -> Extract {
    let features = surface.features();
    Extract {
        points: surface.points().to_vec(),
        vertices: Some(surface.vertices().into()),
        cells: Arc::new(surface.faces().clone()),
        features: Some(Arc::new(ExtractFeatures {
            names: features.names().to_vec(),
            of_cells: features.face_features().to_vec(),
        })),
        fields: vec![
            Field {
                name: DISPLACEMENT.into(),
                association: Association::Vertex,
                components: 3,
                number: NumberType::F64,
                values: displacement.as_flattened().to_vec(),
            },
            Field {
                name: VERTEX.into(),
                association: Association::Vertex,
                components: 1,
                number: NumberType::F64,
                values: surface.vertices().iter().map(|&vertex| f64::from(vertex)).collect(),
            },
        ],
    }
}
