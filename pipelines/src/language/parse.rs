//! From text to checked values.

use serde::de::DeserializeOwned;

use super::error::{LanguageError, Problem, error, from_serde};
use super::scan::scan;

/// Values that can be well-formed and still mean nothing.
pub trait Validate {
    /// Finds the first thing that means nothing.
    ///
    /// # Errors
    /// A [`Problem`] with the way to it.
    fn validate(&self) -> Result<(), Problem>;
}

/// The text behind bytes that should be UTF-8.
///
/// # Errors
/// A [`LanguageError`] at the first byte that is not.
pub fn text<'a>(bytes: &'a [u8], file: &str) -> Result<&'a str, LanguageError> {
    std::str::from_utf8(bytes).map_err(|failure| {
        let valid = String::from_utf8_lossy(&bytes[..failure.valid_up_to()]);
        let byte = bytes.get(failure.valid_up_to()).copied().unwrap_or_default();
        let message = format!("found the byte 0x{byte:02x}, expected UTF-8 text");
        error(&valid, file, valid.len(), String::new(), message, None)
    })
}

/// Reads one value of any type from JSON.
///
/// Stricter than serde_json: no key may stand twice in an object, an array is never taken for a struct, nothing may be nested
/// more than 64 deep, every number must be finite in double precision.
///
/// # Errors
/// A [`LanguageError`] whose line and column are those of the token at fault.
///
/// # Example
/// ```
/// use tombolo_pipelines::language::parse_json;
///
/// #[derive(serde::Deserialize, Debug)]
/// #[serde(deny_unknown_fields)]
/// struct Fluid { density: f64, viscosity: f64 }
///
/// let failure = parse_json::<Fluid>(r#"{"density": 1.0, "viscocity": 0.1}"#, "case.json").unwrap_err();
/// assert_eq!((failure.line, failure.column), (1, 18));
/// assert_eq!(failure.suggestion.as_deref(), Some("viscosity"));
/// ```
pub fn parse_json<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, LanguageError> {
    parse_checked(text, file, |_| Ok(()))
}

/// Reads one value and checks its meaning.
///
/// # Errors
/// As [`parse_json`]; the first [`Problem`] at its place.
pub fn parse_valid<T: DeserializeOwned + Validate>(text: &str, file: &str) -> Result<T, LanguageError> {
    parse_checked(text, file, T::validate)
}

fn parse_checked<T: DeserializeOwned>(
    text: &str,
    file: &str,
    check: impl FnOnce(&T) -> Result<(), Problem>,
) -> Result<T, LanguageError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let root = scan(text).map_err(|syntax| error(text, file, syntax.at, syntax.path, syntax.message, None))?;
    let value: T =
        serde_path_to_error::deserialize(&root).map_err(|failure| from_serde(&failure, &root, text, file))?;
    check(&value).map_err(|problem| problem.locate(&root, text, file))?;
    Ok(value)
}
