//! Names of files that say which step they are of.

use super::{Problem, nearest};

/// Checks the name of a file of a mesh or an extract.
pub(super) fn check_file(pattern: &str) -> Result<(), Problem> {
    let extensions = ["vtu", "vtp", "vtk", "vtpd", "pvtu", "pvtp"];
    let extension = pattern.rsplit_once('.').map_or("", |(_, extension)| extension);
    if !extensions.contains(&extension) {
        let message = format!(
            "found the file `{pattern}`, expected one that ends in `.vtu`, `.vtp`, `.vtk`, `.vtpd`, `.pvtu` or `.pvtp`"
        );
        return Err(Problem::new(message)
            .suggest(nearest(extension, extensions).filter(|_| !extension.is_empty())));
    }
    file_pattern(pattern, 0, 0.0).map(|_| ())
}

/// The file that a pattern stands for at a step: `{cycle}` becomes the cycle with six digits or
/// more, `{cycle:4}` with four or more, `{time}` the time, `{time:3}` the time with three digits
/// after its point.
///
/// ```
/// use tombolo_pipelines::language::file_pattern;
///
/// let file = file_pattern("{cycle}-{cycle:2}-{time}-{time:3}.vtu", 7, 0.5).map_err(|problem| problem.to_string())?;
/// assert_eq!(file, "000007-07-0.5-0.500.vtu");
/// # Ok::<(), String>(())
/// ```
///
/// # Errors
/// A [`Problem`] for braces that hold anything else, with the nearest known name.
pub fn file_pattern(pattern: &str, cycle: u64, time: f64) -> Result<String, Problem> {
    let mut file = String::with_capacity(pattern.len() + 16);
    let mut rest = pattern;
    while let Some((before, after)) = rest.split_once('{') {
        file.push_str(before);
        let Some((inside, after)) = after.split_once('}') else {
            return Err(Problem::new("found '{' without its '}'"));
        };
        let (name, digits) =
            inside.split_once(':').map_or((inside, None), |(name, digits)| (name, Some(digits)));
        let digits = digits.map(|digits| file_digits(inside, digits)).transpose()?;
        match name {
            "cycle" => file.push_str(&format!("{cycle:0width$}", width = digits.unwrap_or(6))),
            "time" => match digits {
                Some(digits) => file.push_str(&format!("{time:.digits$}")),
                None => file.push_str(&time.to_string()),
            },
            _ => {
                let message = format!(
                    "found `{{{name}}}` in a file's name, expected `{{cycle}}` or `{{time}}`"
                );
                return Err(Problem::new(message).suggest(nearest(name, ["cycle", "time"])));
            }
        }
        rest = after;
    }
    if rest.contains('}') {
        return Err(Problem::new("found '}' without its '{'"));
    }
    file.push_str(rest);
    Ok(file)
}

/// How many digits a number in a file's name has.
fn file_digits(inside: &str, digits: &str) -> Result<usize, Problem> {
    match digits.parse() {
        Ok(digits @ 0..=20) => Ok(digits),
        _ => Err(Problem::new(format!(
            "found `{{{inside}}}` in a file's name, expected a number of digits from 0 to 20 behind the colon"
        ))),
    }
}

/// The text that a pattern stands for in a picture: as [`file_pattern`], with `{camera}` for the
/// camera's name.
///
/// # Errors
/// As [`file_pattern`].
pub(crate) fn picture_pattern(
    pattern: &str,
    cycle: u64,
    time: f64,
    camera: &str,
) -> Result<String, Problem> {
    file_pattern(&pattern.replace("{camera}", camera), cycle, time)
}
