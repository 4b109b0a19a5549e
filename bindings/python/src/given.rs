//! Values of Python as they were given: meshes, mappings and names.

use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyString};

use crate::error::{Mistake, argument, raised};

pub(crate) type Given<'py> = Bound<'py, PyAny>;
pub(crate) type Read<T> = Result<T, Mistake>;

/// What a mesh is given as.
pub(crate) const MESH: &str = "a tombolo.Mesh, or a dict with 'points' and 'cells'";

fn kind(given: &Given<'_>) -> String {
    let name = given.get_type().name();
    name.map_or_else(|_| "an object".to_owned(), |name| format!("a {name}"))
}

/// What was given, as Python writes it, or the beginning of that.
pub(crate) fn found(given: &Given<'_>) -> String {
    let text = given.repr().map_or_else(|_| kind(given), |text| text.to_string());
    text.chars().take(100).collect()
}

pub(crate) fn python(what: &str) -> impl Fn(PyErr) -> Mistake + '_ {
    move |error| raised(error, |error| argument(what, error.to_string(), "what can be read"))
}

pub(crate) fn name(given: &Given<'_>, what: &str) -> Read<String> {
    let name = given.cast::<PyString>().ok().map(|name| name.to_string_lossy().into_owned());
    name.filter(|name| !name.is_empty() && !name.chars().any(char::is_control)).ok_or_else(|| {
        argument(what, found(given), "a name of one letter or more, on one line").into()
    })
}

/// The entries of a mapping.
pub(crate) fn entries<'py>(
    given: &Given<'py>,
    what: &str,
    expected: &str,
) -> Read<Vec<[Given<'py>; 2]>> {
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(dict.iter().map(|(key, value)| [key, value]).collect());
    }
    let mapping = given.cast::<PyMapping>().map_err(|_| argument(what, kind(given), expected))?;
    let items = mapping.items().map_err(python(what))?;
    items
        .iter()
        .map(|item| {
            let (key, value) = item.extract().map_err(python(what))?;
            Ok([key, value])
        })
        .collect()
}

/// Whether a mesh is given as a mapping of its parts, rather than as a `tombolo.Mesh`.
pub(crate) fn is_mapping(mesh: &Given<'_>, what: &str) -> Read<bool> {
    // The error of a dict that has no attributes would cost more than all else here.
    if mesh.cast::<PyDict>().is_ok() {
        return Ok(true);
    }
    let points = mesh.getattr_opt(intern!(mesh.py(), "points")).map_err(python(what))?;
    Ok(points.is_none())
}

/// What a mapping has under a name.
fn item<'py>(given: &Given<'py>, name: &Bound<'py, PyString>) -> PyResult<Option<Given<'py>>> {
    if let Ok(dict) = given.cast::<PyDict>() {
        return dict.get_item(name);
    }
    match given.cast::<PyMapping>() {
        Ok(mapping) if mapping.contains(name)? => mapping.get_item(name).map(Some),
        _ => Ok(None),
    }
}

/// Whether this is one mesh, rather than meshes by their names: one of them may be called `points`.
pub(crate) fn is_mesh(given: &Given<'_>) -> Read<bool> {
    let what = "channels";
    if !is_mapping(given, what)? {
        return Ok(true);
    }
    let points = item(given, intern!(given.py(), "points")).map_err(python(what))?;
    match points {
        Some(points) => Ok(points.cast::<PyMapping>().is_err() && is_mapping(&points, what)?),
        None => Ok(false),
    }
}

/// A part of a mesh; `None` where it is left out.
pub(crate) fn part<'py>(
    mesh: &Given<'py>,
    what: &str,
    name: &Bound<'py, PyString>,
) -> Read<Option<Given<'py>>> {
    let found = if mesh.cast::<PyDict>().is_ok() {
        item(mesh, name)
    } else {
        match mesh.getattr_opt(name) {
            Ok(None) if mesh.cast::<PyMapping>().is_err() => {
                return Err(argument(what, kind(mesh), MESH).into());
            }
            Ok(None) => item(mesh, name),
            found => found,
        }
    };
    Ok(found.map_err(python(what))?.filter(|found| !found.is_none()))
}
