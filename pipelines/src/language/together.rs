//! Messages of viewers that are about the viewers themselves: links for others, names, the camera of
//! the one that drives, notes. Nothing of the run changes by them.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::Problem;
use super::parse::Validate;
use crate::limits::{Exceeded, Limit, NAME, NOTE, NOTES, VIEWER_NAME, VIEWS};

/// A message about the viewers themselves.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Together {
    /// Asks for a link that opens one browser, once.
    Link {
        /// What the browser may do then.
        r#for: LinkFor,
    },
    /// Gives the viewer a name, which others see.
    Name {
        /// The name; one of spaces alone takes it away.
        name: String,
    },
    /// Follows the camera of the one that drives, or does so no more.
    Follow {
        /// Whether it follows.
        on: bool,
    },
    /// The camera of the one that drives.
    Camera(CameraStand),
    /// Pins a note to a place and a cycle.
    Note(NewNote),
    /// Takes a note away.
    RemoveNote {
        /// The number of the note.
        number: u64,
    },
    /// Chooses the views whose frames the viewer is sent.
    Views {
        /// Their names; all views where this is left out. A name that no view has yet counts once one
        /// has it.
        names: Option<BTreeSet<String>>,
    },
}

/// The rights that a link gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LinkFor {
    /// Its browser sees everything and changes nothing.
    Watch,
    /// Its browser may be the one that drives.
    Drive,
}

/// The place and direction of a camera, in the coordinates of the mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraStand {
    /// The place of its eye.
    pub position: [f64; 3],
    /// The place that it looks at.
    pub focal_point: [f64; 3],
    /// The direction that is up in its picture.
    pub view_up: [f64; 3],
    /// Whether lines that are parallel stay so in its picture.
    pub parallel: bool,
    /// Half the height of the picture in units of the mesh, where it is `parallel`.
    pub parallel_scale: f64,
    /// The angle between the picture's bottom and its top in degrees, where it is not `parallel`.
    pub view_angle: f64,
}

/// A note to be pinned.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NewNote {
    /// The text, of one line or several.
    pub text: String,
    /// The place, in the coordinates of the mesh.
    pub at: [f64; 3],
    /// The cycle; that of now if left out.
    pub cycle: Option<u64>,
}

/// A note that is pinned in the picture of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PinnedNote {
    /// The note's number in its run, which no later note gets again.
    pub number: u64,
    /// The text.
    pub text: String,
    /// The place, in the coordinates of the mesh.
    pub at: [f64; 3],
    /// The cycle.
    pub cycle: u64,
    /// The name of its author, or of the viewer where that has given itself none.
    pub by: String,
}

/// Adds a note to those of a run.
///
/// # Errors
/// [`Exceeded`] where there are too many, or its text is too long.
pub(super) fn pin(notes: &mut Vec<PinnedNote>, note: PinnedNote) -> Result<(), Exceeded> {
    NOTES.check(notes.len() + 1)?;
    NOTE.check(note.text.chars().count())?;
    notes.push(note);
    Ok(())
}

impl Validate for Together {
    fn validate(&self) -> Result<(), Problem> {
        match self {
            Together::Link { .. } | Together::Follow { .. } | Together::RemoveNote { .. } => Ok(()),
            Together::Name { name } => check_text(name.trim(), VIEWER_NAME, |_| false)
                .map_err(|problem| problem.within("name").within("name")),
            Together::Camera(camera) => {
                camera.validate().map_err(|problem| problem.within("camera"))
            }
            Together::Note(note) => note.validate().map_err(|problem| problem.within("note")),
            Together::Views { names } => check_names(names.iter().flatten())
                .map_err(|exceeded| Problem::from(exceeded).within("names").within("views")),
        }
    }
}

impl Validate for CameraStand {
    fn validate(&self) -> Result<(), Problem> {
        let Self { position, focal_point, view_up, parallel: _, parallel_scale, view_angle } = self;
        if position == focal_point {
            let message = "found the place of the camera itself, expected another";
            return Err(Problem::new(message).within("focal_point"));
        }
        if view_up.iter().all(|component| *component == 0.0) {
            return Err(Problem::new("found no direction, expected one").within("view_up"));
        }
        if *parallel_scale <= 0.0 {
            let message = format!("found {parallel_scale}, expected more than 0");
            return Err(Problem::new(message).within("parallel_scale"));
        }
        if !(*view_angle > 0.0 && *view_angle < 180.0) {
            let message = format!("found {view_angle}, expected more than 0 and less than 180");
            return Err(Problem::new(message).within("view_angle"));
        }
        Ok(())
    }
}

impl Validate for NewNote {
    fn validate(&self) -> Result<(), Problem> {
        let text = self.text.trim();
        if text.is_empty() {
            return Err(Problem::new("found an empty text").within("text"));
        }
        check_text(text, NOTE, |c| c == '\n').map_err(|problem| problem.within("text"))
    }
}

/// Whether names of views are few and short enough.
fn check_names<'a>(mut names: impl Iterator<Item = &'a String> + Clone) -> Result<(), Exceeded> {
    VIEWS.check(names.clone().count())?;
    names.try_for_each(|name| NAME.check(name.chars().count()))
}

/// Whether a text that others see is short enough and holds nothing that is not seen.
fn check_text(text: &str, limit: Limit, allowed: impl Fn(char) -> bool) -> Result<(), Problem> {
    limit.check(text.chars().count()).map_err(Problem::from)?;
    match text.chars().find(|&c| is_hidden(c) && !allowed(c)) {
        None => Ok(()),
        Some(hidden) => {
            let message = format!("found the character {}", hidden.escape_unicode());
            Err(Problem::new(format!("{message}, expected characters that are seen")))
        }
    }
}

/// Whether a character is a control character, or turns the direction of what stands around it, so
/// that a text could look like another.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{200e}' | '\u{200f}')
}

#[cfg(test)]
mod tests {
    use super::super::{Message, parse_message};
    use super::*;

    fn read(text: &str) -> Result<Together, String> {
        match parse_message(text).1 {
            Ok(Message::Together(together)) => Ok(together),
            Ok(other) => panic!("{other:?}"),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn a_name_is_short_and_all_of_it_is_seen() {
        let named = |name: &str| read(&serde_json::json!({"name": {"name": name}}).to_string());
        for good in ["Anna", "  Anna  ", "", "Łukasz 李 👩‍🔬", &"x".repeat(40)] {
            named(good).unwrap();
        }
        let error = named(&"x".repeat(41)).unwrap_err();
        assert!(error.contains("name.name: found 41 characters, expected at most 40"), "{error}");
        for bad in ["a\nb", "a\u{0}", "\u{202e}annA", "a\u{2066}b"] {
            let error = named(bad).unwrap_err();
            assert!(error.contains("expected characters that are seen"), "{error}");
        }
    }

    #[test]
    fn a_note_has_a_text_and_a_place() {
        let note = |text: &str, at: &str| {
            read(&format!(r#"{{"note": {{"text": {text}, "at": {at}, "cycle": 3}}}}"#))
        };
        let good = note(r#""here\nand there""#, "[1, 2.5, -3]").unwrap();
        let expected =
            NewNote { text: "here\nand there".into(), at: [1.0, 2.5, -3.0], cycle: Some(3) };
        assert_eq!(good, Together::Note(expected));
        for (text, at, reason) in [
            ("\" \"", "[1, 2, 3]", "note.text: found an empty text"),
            ("\"a\\u0007\"", "[1, 2, 3]", "note.text: found the character \\u{7}"),
            ("\"a\"", "[1, 2]", "note.at"),
            ("\"a\"", "[1, 2, 1e999]", "beyond the range of double precision"),
        ] {
            let error = note(text, at).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
        let long = format!("\"{}\"", "é".repeat(501));
        assert!(note(&long, "[0, 0, 0]").unwrap_err().contains("found 501 characters"));
    }

    #[test]
    fn views_are_chosen_by_name() {
        let chosen = |names: &[&str]| {
            let names = names.iter().map(|name| (*name).to_owned()).collect();
            Together::Views { names: Some(names) }
        };
        assert_eq!(read(r#"{"views": {"names": ["b", "a", "b"]}}"#).unwrap(), chosen(&["a", "b"]));
        assert_eq!(read(r#"{"views": {"names": []}}"#).unwrap(), chosen(&[]));
        assert_eq!(read(r#"{"views": {}}"#).unwrap(), Together::Views { names: None });
        let many: Vec<String> = (0..257).map(|number| number.to_string()).collect();
        for (names, reason) in [
            (serde_json::json!(many), "views.names: found 257 pipelines that stream"),
            (serde_json::json!(["x".repeat(201)]), "views.names: found 201 characters"),
            (serde_json::json!("a"), "views.names"),
        ] {
            let error = read(&serde_json::json!({"views": {"names": names}}).to_string());
            let error = error.unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
    }

    #[test]
    fn a_camera_looks_somewhere() {
        let camera = |change: &str| {
            let mut camera = serde_json::json!({"position": [0, 0, 1], "focal_point": [0, 0, 0],
                "view_up": [0, 1, 0], "parallel": false, "parallel_scale": 1, "view_angle": 30});
            let change: serde_json::Value = serde_json::from_str(change).unwrap();
            camera.as_object_mut().unwrap().extend(change.as_object().unwrap().clone());
            read(&serde_json::json!({"camera": camera}).to_string())
        };
        camera("{}").unwrap();
        for (change, reason) in [
            (r#"{"position": [0, 0, 0]}"#, "camera.focal_point"),
            (r#"{"view_up": [0, 0, 0]}"#, "camera.view_up"),
            (r#"{"parallel_scale": 0}"#, "camera.parallel_scale"),
            (r#"{"view_angle": 180}"#, "camera.view_angle"),
            (r#"{"roll": 1}"#, "roll"),
        ] {
            let error = camera(change).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
    }
}
